"""The robot's numbers: Table I of the article and what it leaves open, each with its source.

Every model in this package, analytic or MuJoCo, is built from one `RobotParameters`. Values are
checked here, on input; the rest of the package trusts them.
"""

from ttwmr_mj.config import Config as Config  # whoever knows the robot knows it from here
from ttwmr_mj.robot.bodies import Casters as Casters
from ttwmr_mj.robot.bodies import Hitch as Hitch
from ttwmr_mj.robot.bodies import Tractor as Tractor
from ttwmr_mj.robot.bodies import Trailer as Trailer
from ttwmr_mj.robot.parameters import RobotParameters as RobotParameters
from ttwmr_mj.robot.parameters import WhichTrailer as WhichTrailer
from ttwmr_mj.robot.parameters import merged as merged
from ttwmr_mj.robot.servo import Servo as Servo
