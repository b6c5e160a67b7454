"""Colours with one meaning everywhere in a recording, as RGB.

Those of curves are of middle brightness: they lie on the light floor and on the dark plots.
"""

Colour = tuple[int, int, int]

TRACTOR: Colour = (45, 145, 225)
TRAILER: Colour = (222, 82, 165)
REFERENCE: Colour = (240, 150, 20)
REFERENCE_BAND: Colour = (255, 206, 128)  # wide and pale, so that what runs along it stays seen
REFERENCE_PLACE: Colour = (255, 232, 192)
ESTIMATE: Colour = (35, 170, 115)
RIGHT: Colour = (45, 145, 225)
LEFT: Colour = (235, 100, 60)
COMMAND_RIGHT: Colour = (170, 210, 240)
COMMAND_LEFT: Colour = (250, 200, 180)
FORCE: Colour = (112, 84, 196)
LIMIT: Colour = (150, 155, 162)
FLOOR: Colour = (222, 226, 231)
GRID: Colour = (198, 204, 211)
IDLE: Colour = (70, 76, 84)
RESTING: Colour = (96, 110, 128)
ALERT: Colour = (226, 62, 50)
WORDS: Colour = (255, 255, 255)  # on what is dark
INK: Colour = (16, 18, 22)  # words on what is light
FOUND_LABEL: Colour = (90, 255, 120)
TRUE_LABEL: Colour = (255, 255, 255)
COVARIANCE: Colour = (255, 90, 200)
SKY: Colour = (244, 246, 249)
BACKGROUND: Colour = (24, 26, 30)  # of pictures and keys
