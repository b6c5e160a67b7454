"""What a run writes: `[output]`."""

from pydantic import Field

from ttwmr_mj.robot import Config


class OutputOptions(Config):
    """Which files a run writes in addition to its numbers."""

    recording: bool = Field(default=True, description="write run.rrd for the Rerun viewer")
    figures: bool = Field(
        default=True,
        description="write summary.png, .svg and .pdf, the run in one figure; compare: figures/",
    )
    paper_plots: bool = Field(
        default=False,
        description="write figures/*.png and *.svg: the article's plots, one quantity each",
    )
    save_frames: bool = Field(
        default=False, description="write frames/: the camera's images with COCO annotations"
    )
    physics_rate: bool = Field(
        default=False,
        description="write physics.parquet: the state at every physics step (contact plant only)",
    )
