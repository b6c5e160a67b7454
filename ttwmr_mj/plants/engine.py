"""MuJoCo, imported whatever the environment says.

With a MUJOCO_GL that names nothing, or whose libraries are missing, its import fails, in runs too
that draw nothing. What draws asks for its backend later, by name (`vision.camera.gl`). The import
starts a `python -c` that looks for GLFW, and would run what lies in the working directory.
"""

from ttwmr_mj.files import variable

with variable("MUJOCO_GL", None), variable("PYTHONSAFEPATH", "1"):
    import mujoco
    from mujoco import batch

__all__ = ["batch", "mujoco"]
