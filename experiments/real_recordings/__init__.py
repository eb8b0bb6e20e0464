"""`diagnose` on recordings of real vehicles and rigs: what was left out, and what it is worth on runs not fitted."""
