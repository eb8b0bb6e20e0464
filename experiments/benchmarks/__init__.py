"""Speed: what the tool takes, measured as ratios where the machine's own speed would count."""
