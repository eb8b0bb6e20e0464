"""Likelihoods: how probable a recording is under a model."""

from .output_error import concentrated_sigma, errors, negative_log_likelihood

__all__ = ["concentrated_sigma", "errors", "negative_log_likelihood"]
