"""`python -m jaxsub` is the command `jaxsub`."""

from .cli import main

main()
