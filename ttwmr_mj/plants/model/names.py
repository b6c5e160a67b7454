"""Names of the robot's parts in the MjModel.

Those of the tractor and the first trailer are in models/ttwmr.xml. What follows is made of the
same trailer (`train_parts`); the second one's parts are called trailer_2/…, the third's trailer_3/…
"""

WHEELS = ("wheel_right", "wheel_left")
CASTERS = ("caster_tractor", "caster_trailer_right", "caster_trailer_left")  # of one trailer
CONTACTS = (*WHEELS, *CASTERS)


def trailer_part(name: str, index: int) -> str:
    """A trailer's part (0: the first) that is called `name` in the first one."""
    return f"{namespace(index)}{name}"


def namespace(index: int) -> str:
    """What the names of a trailer's parts begin with; empty for the first (0)."""
    return f"trailer_{index + 1}/" if index else ""


def hitches(trailers: int) -> tuple[str, ...]:
    """Joints, front to back."""
    return tuple(trailer_part("hitch", i) for i in range(trailers))


def casters(trailers: int) -> tuple[str, ...]:
    """Bodies and collision geoms of the balls: of the tractor, then of each trailer right, left."""
    own = (trailer_part(name, i) for i in range(trailers) for name in CASTERS[1:])
    return (CASTERS[0], *own)


def contacts(trailers: int) -> tuple[str, ...]:
    """All that touches the floor: wheels, then balls."""
    return (*WHEELS, *casters(trailers))


def contact_sensor(name: str) -> str:
    """The sensor of what touches the floor."""
    start, slash, part = name.rpartition("/")
    return f"{start}{slash}contact_{part}"
