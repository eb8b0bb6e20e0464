"""Raw sensors of real motions through `jaxsub navigate` alone, against references."""
