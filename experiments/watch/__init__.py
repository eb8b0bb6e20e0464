"""False alarms, delays and places of `jaxsub watch`, beside a fixed threshold and the fuzzy rule."""
