"""Imports what all jobs need, once, in the server that their processes are forked from.

The server would end with what such an import raises. Here it goes on, and every job's process tries
again and can say so.
"""

from contextlib import suppress

from ttwmr_mj.studies.pool.preload import load

with suppress(Exception):
    load()
