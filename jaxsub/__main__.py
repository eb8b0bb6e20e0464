"""`python -m jaxsub` is the command `jaxsub`."""

from .cli import main

if __name__ == "__main__":
    main()
