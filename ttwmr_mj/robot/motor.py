"""The numbers of a servo that is a motor: winding, gear, drive electronics, firmware.

The presets come from data sheets of two Robotis servos with one motor and two gears. Sheets give
stall torque, stall current and the speed without load, at 12 V; with an assumed friction of the
gear (3 % of stall) these three give resistance, motor constant and efficiency. Both sheets lead to
the same motor constant, 7.2 to 7.3 mV·s/rad, which neither of them states.
"""

from typing import Any, ClassVar, Literal

from pydantic import Field, model_validator

from ttwmr_mj.config import Config

MOTOR_PRESETS: dict[str, dict[str, float | int]] = {
    # AX-12 class: 254:1, 59 rev/min at 12 V, 1.5 A at stall. The older sheet's holding torque of
    # 16.5 kgf·cm is the article's 1.62 N·m.
    "lab": {
        "gear_ratio": 254.0,
        "gear_efficiency": 0.602,  # (1.62 + 0.05) N·m at 1.5 A, over 254·K
        "gear_friction_n_m": 0.05,  # 3 % of stall, assumed
        "gear_damping_n_m_s_rad": 0.005,  # 2 % of stall at full speed, assumed
        "resistance_ohm": 8.0,  # 12 V / 1.5 A
        "torque_constant_n_m_a": 0.00728,  # (12 V − R·0.073 A) / (254 · 6.18 rad/s)
        "back_emf_v_s_rad": 0.00728,  # the same constant in SI units
        "current_limit_a": 1.5,  # what the sheet's stall draws
        # P and I of a speed loop whose 10 ms of encoder window leave it well damped
        "speed_gain_v_s_rad": 0.5,
        "speed_integral_gain_v_rad": 40.0,
    },
    # AX-12W class: the same motor at 32:1, 470 rev/min, 0.2 N·m and 1.4 A at stall.
    "fast": {
        "gear_ratio": 32.0,
        "gear_efficiency": 0.637,
        "gear_friction_n_m": 0.006,
        "gear_damping_n_m_s_rad": 0.0001,
        "resistance_ohm": 8.57,
        "torque_constant_n_m_a": 0.00722,
        "back_emf_v_s_rad": 0.00722,
        "current_limit_a": 1.4,
        "speed_gain_v_s_rad": 1.5,
        "speed_integral_gain_v_rad": 20.0,
    },
}


class Motor(Config):
    """A direct-current motor with gear, encoder and firmware in each wheel's servo.

    With it, `stall_torque_n_m` and `velocity_gain_n_m_s_rad` of the servo have no part; its ramp
    and its reflected inertia have. A preset fills in what is not given. Left out, the servo is an
    ideal one that turns speed errors into torque.
    """

    same_in_batch: ClassVar[frozenset[str]] = frozenset(
        {"loop_period_s", "encoder_window_s", "command_delay_s"}
    )

    preset: Literal["lab", "fast"] = Field(
        default="lab",
        description="data sheet that fills in the rest; lab: AX-12 class, 6.2 rad/s without load; "
        "fast: AX-12W class, 49 rad/s; default: the servo's preset",
    )
    supply_voltage_v: float = Field(
        default=12.0, ge=1e-12, le=100, description="largest voltage on the winding; typically 12"
    )
    resistance_ohm: float = Field(
        default=8.0, ge=1e-12, le=1e4, description="R: resistance of winding and drive; typically 8"
    )
    torque_constant_n_m_a: float = Field(
        default=0.00728,
        ge=1e-12,
        le=10,
        description="K_t: motor torque per ampere; typically 0.007",
    )
    back_emf_v_s_rad: float = Field(
        default=0.00728,
        ge=1e-12,
        le=10,
        description="K_e: voltage induced per rad/s of the motor, equal to K_t in SI units; "
        "typically 0.007",
    )
    current_limit_a: float = Field(
        default=1.5, ge=1e-12, le=1e3, description="largest current of the drive; typically 1.5"
    )
    gear_ratio: float = Field(
        default=254.0,
        ge=1,
        le=1e4,
        description="N: turns of the motor per turn of the wheel; typically 30 to 300",
    )
    gear_efficiency: float = Field(
        default=0.602,
        ge=1e-12,
        le=1,
        description="η: share of the motor's torque that reaches the wheel; typically 0.6",
    )
    gear_friction_n_m: float = Field(
        default=0.05,
        ge=0,
        le=100,
        description="torque of dry gear friction at the wheel; typically 3 % of stall",
    )
    gear_damping_n_m_s_rad: float = Field(
        default=0.005,
        ge=0,
        le=100,
        description="coefficient of viscous gear friction at the wheel; typically 0.005",
    )
    dead_band_v: float = Field(
        default=0.1,
        ge=0,
        le=10,
        description="voltage below which the drive gives none; typically 0.1",
    )
    pwm_steps: int = Field(
        default=1023,
        ge=0,
        le=10**6,
        description="voltage levels from zero to full, 0 for any voltage; typically 1023",
    )
    encoder_counts_per_turn: int = Field(
        default=1229,
        ge=0,
        le=10**7,
        description="encoder counts per turn of the wheel, 0 for an exact encoder; typically "
        "1229, which is 0.293 degrees",
    )
    encoder_window_s: float = Field(
        default=0.01,
        ge=1e-6,
        le=1,
        description="time over which counts are differenced to a speed, a whole number of loop "
        "periods; typically 0.01",
    )
    loop_period_s: float = Field(
        default=0.001,
        ge=1e-6,
        le=1,
        description="period of the firmware's speed loop, a whole number of physics steps; "
        "typically 0.001",
    )
    feedforward_share: float = Field(
        default=1.0,
        ge=0,
        le=2,
        description="share of the back-EMF at the set speed that the firmware adds; typically 1",
    )
    speed_gain_v_s_rad: float = Field(
        default=0.5, ge=0, le=1e4, description="P gain of the speed loop; typically 0.5"
    )
    speed_integral_gain_v_rad: float = Field(
        default=40.0, ge=0, le=1e6, description="I gain of the speed loop; typically 40"
    )
    command_delay_s: float = Field(
        default=0.001,
        ge=0,
        le=1,
        description="time that a set speed or torque takes to the firmware, a whole number of "
        "loop periods; typically 0.001",
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_from_preset(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        return {**MOTOR_PRESETS.get(str(given.get("preset")), {}), **given}

    @property
    def torque_per_ampere(self) -> float:
        """η·N·K_t: torque on the wheel per ampere [N·m/A]."""
        return self.gear_efficiency * self.gear_ratio * self.torque_constant_n_m_a

    @property
    def volts_per_speed(self) -> float:
        """N·K_e: back-EMF per speed of the wheel [V·s/rad]."""
        return self.gear_ratio * self.back_emf_v_s_rad

    @property
    def stall_torque_n_m(self) -> float:
        """What the standing wheel gets at full voltage, gear friction not yet taken off."""
        current = min(self.supply_voltage_v / self.resistance_ohm, self.current_limit_a)
        return self.torque_per_ampere * current
