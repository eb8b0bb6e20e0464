"""Metres north and east against latitude and longitude."""

import math

_EQUATOR, _FLATTENING = 6378137.0, 1.0 / 298.257223563


def radii(latitude: float) -> tuple[float, float]:
    r"""Metres north per radian of latitude, and metres east per radian of longitude, near `latitude` (rad).

    $M = a(1 - e^2)/(1 - e^2\sin^2\varphi)^{3/2}$ and $N\cos\varphi$ with $N = a/\sqrt{1 - e^2\sin^2\varphi}$ of WGS 84.
    Both change by 1e-4 of themselves over 10 km at mid latitudes. Source: Groves (2013), §2.4.
    """
    eccentricity = _FLATTENING * (2.0 - _FLATTENING)
    root = math.sqrt(1.0 - eccentricity * math.sin(latitude) ** 2)
    return _EQUATOR * (1.0 - eccentricity) / root**3, _EQUATOR / root * math.cos(latitude)
