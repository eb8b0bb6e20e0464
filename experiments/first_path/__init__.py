"""Does the first path name what was concealed, stay silent on clean runs, and admit what it does not know?"""
