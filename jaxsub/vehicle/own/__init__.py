"""Models of a user's own: equations in Python beside the vehicle file's kinds."""

from .checks import channels_of, check_model, model_of
from .load import loaded, source_of
from .model import Model, numbers_of
from .own_model import OwnModel

__all__ = ["Model", "OwnModel", "channels_of", "check_model", "loaded", "model_of", "numbers_of", "source_of"]
