"""The manoeuvring paper in full: its scenarios, estimators and identifiability, and what it could not show."""
