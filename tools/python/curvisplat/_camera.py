"""Cameras, and their way around the data."""

from __future__ import annotations

import dataclasses
from typing import List, Optional, Tuple

from . import _arguments, _core

Point = Tuple[float, float, float]
_MOST_FRAMES = 100_000  # as of `curvisplat render --frames`


@dataclasses.dataclass(frozen=True)
class Camera:
    """A place to look from, with VTK's names. All lengths are in the grid's unit, after `scale=` of render().

    position, focal_point: the viewer and what it looks at, (x, y, z). view_up: the direction that is up in the picture.
    parallel_scale: half the picture's height, for parallel rays. view_angle: the angle over the picture's height in degrees, for
    perspective. With neither, rays are parallel and all of the data fits into the picture.
    """

    position: Point
    focal_point: Point = (0.0, 0.0, 0.0)
    view_up: Point = (0.0, 0.0, 1.0)
    parallel_scale: Optional[float] = None
    view_angle: Optional[float] = None

    def __post_init__(self) -> None:
        for name in ("position", "focal_point", "view_up"):
            object.__setattr__(self, name, _arguments.numbers(name, getattr(self, name), "(x, y, z)", 3))
        for name in ("parallel_scale", "view_angle"):
            object.__setattr__(self, name, _arguments.maybe(name, getattr(self, name), _arguments.number))
        if self.parallel_scale is not None and self.view_angle is not None:
            raise _core.UsageError("a camera has parallel_scale or view_angle, not both")

    @_arguments.in_one_line
    def turned(self, degrees: float) -> "Camera":
        """The camera after so many degrees around `view_up` through the focal point, anticlockwise seen from above."""
        position, view_up = _core.orbited(self.position, self.focal_point, self.view_up, _arguments.number("degrees", degrees))
        return dataclasses.replace(self, position=position, view_up=view_up)

    def options(self) -> dict:
        """The keyword arguments of render() that are this camera."""
        return {name: value for name, value in vars(self).items() if value is not None}


@_arguments.in_one_line
def orbit(camera: Camera, frames: int = 90, degrees: float = 360) -> List[Camera]:
    """`frames` cameras around the focal point, as `--orbit` has them: 360 degrees are a loop without its last frame twice.

    Give the camera a parallel_scale or a view_angle, or each frame is fitted to the data by itself; Cache.camera() has one.
    """
    if not isinstance(camera, Camera):
        raise _arguments.wrong("camera", camera, "a Camera")
    count, whole = _arguments.whole("frames", frames, 1), _arguments.number("degrees", degrees)
    if count > _MOST_FRAMES:
        raise _core.UsageError(f"frames: {count}; expected at most {_MOST_FRAMES}")
    return [camera.turned(whole * frame / count) for frame in range(count)]
