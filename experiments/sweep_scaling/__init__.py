"""Sweeps: how they scale on one device, on two and on a cluster, what memory they take, and whether they agree."""
