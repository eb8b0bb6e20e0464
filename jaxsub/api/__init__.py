"""The front door: what `import jaxsub as js` offers of fits, simulations, diagnoses and sweeps, and their results.

Commands call these functions too, so that a script and the command line give one answer and write the same files.
"""
