"""Colours with one meaning everywhere in a recording, as RGB."""

Colour = tuple[int, int, int]

TRACTOR: Colour = (86, 180, 233)
TRAILER: Colour = (232, 120, 190)
REFERENCE: Colour = (245, 165, 30)
ESTIMATE: Colour = (90, 200, 130)
RIGHT: Colour = (86, 180, 233)
LEFT: Colour = (240, 120, 90)
COMMAND_RIGHT: Colour = (190, 225, 245)
COMMAND_LEFT: Colour = (250, 205, 190)
FORCE: Colour = (250, 225, 60)
FLOOR: Colour = (112, 118, 128)
GRID: Colour = (96, 102, 111)
IDLE: Colour = (70, 76, 84)
ALERT: Colour = (235, 80, 70)
FOUND_LABEL: Colour = (90, 255, 120)
TRUE_LABEL: Colour = (255, 255, 255)
COVARIANCE: Colour = (255, 90, 200)
BACKGROUND: Colour = (24, 26, 30)
