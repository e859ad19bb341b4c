"""What the per-segment kernels compute, for people: titles, equation numbers, names and units."""

from typing import NamedTuple


class Note(NamedTuple):
    """A kernel's title and its results as `name [unit]`, over and over where there are more."""

    title: str
    outputs: tuple[str, ...]

    def output(self, k: int) -> tuple[str, str]:
        """Name and unit of the k-th result."""
        name, unit = self.outputs[k % len(self.outputs)].split(" ", 1)
        return name, unit.strip("[]")


_LOAD = ("moment [N m]", "force [N]")
_BODY = ("mass [kg]", "inertia [kg m^2]", "com [m]")
# Inertia, coupling and mass of an articulated body, and its bias wrench.
_ARTICULATED = ("J [kg m^2]", "H [kg m]", "mass [kg]", "n [N m]", "f [N]")
_JACOBIAN = ("dtau_dq [N m/rad]", "dtau_dqd [N m s/rad]")

NOTES = {
    "trigonometry": Note("cosines and sines of the coordinates", ("c [1]", "s [1]")),
    "turning": Note(
        "eq (4), angular velocities of thread and disc, and their accelerations at zero qdd",
        ("thread_rate [rad/s]", "thread_bias [rad/s^2]", "rate [rad/s]", "bias [rad/s^2]"),
    ),
    "carry_pose": Note("eq (1), rotation and position in the root frame", ("R [1]", "r [m]")),
    "carry_velocity": Note("velocity of the disc's origin, its frame", ("v [m/s]",)),
    "together": Note("the disc with what it carries", _BODY),
    "sum_wrench": Note("sum of the wrenches on the disc, its frame", _LOAD),
    "difference": Note("wrench less the loads, the disc's frame", _LOAD),
    "inward_wrench": Note(
        "generalized forces of the wrench beyond the thread, and that wrench on the disc before",
        ("tau [N m]", "passed_moment [N m]", "passed_force [N]"),
    ),
    "felt_at_root": Note("acceleration of free fall, the other way", ("felt [m/s^2]",)),
    "accelerate": Note(
        "Newton-Euler, accelerations of the disc, its frame", ("alpha [rad/s^2]", "a [m/s^2]")
    ),
    "inertial_wrench": Note("Newton-Euler, wrench of the disc's motion, its frame", _LOAD),
    "loaded_body": Note(
        "articulated inertia and bias wrench of the disc with all beyond it", _ARTICULATED
    ),
    "inward_taut": Note(
        "what passes the thread inward, its tension alone",
        (
            *(f"passed_{each}" for each in _ARTICULATED),
            "tension [kg, N]",
            "free [1/kg, m/s^2]",
            "X [1/m]",
            "y [rad/s^2]",
        ),
    ),
    "inward_general": Note(
        "what passes the joint inward",
        (
            *(f"passed_{each}" for each in _ARTICULATED),
            "gain [1, 1/m]",
            "rest [rad/s^2]",
            "drift [rad/s^2, m/s^2]",
            "none [1]",
        ),
    ),
    "outward_taut": Note(
        "accelerations of coordinates and disc",
        ("qdd [rad/s^2]", "alpha [rad/s^2]", "a [m/s^2]"),
    ),
    "outward_general": Note(
        "accelerations of coordinates and disc",
        ("qdd [rad/s^2]", "alpha [rad/s^2]", "a [m/s^2]"),
    ),
    "gathered": Note(
        "kinetic energy of the disc, momentum of it and all beyond, its frame",
        ("kinetic [J]", "angular [N m s]", "linear [N s]"),
    ),
    "momentum_step": Note(
        "eq (7), canonical momenta and dT/dq of the segment, momentum on the disc before",
        ("p [N m s]", "dT_dq [N m]", "passed_angular [N m s]", "passed_linear [N s]"),
    ),
    "field_energy": Note("energy of the disc's weight", ("weight [J]",)),
    "tension_of": Note("tension of the thread", ("tension [N]",)),
    "span_wrenches": Note(
        "forces between discs, eq (5) for springs: wrench on each, its frame", _LOAD
    ),
    "span_slopes": Note("wrenches of a unit of the forces' number, discs' frames", _LOAD),
    "span_energy": Note("energy of the forces between discs", ("energy [J]",)),
    "span_volume": Note("volume of the air between the discs", ("volume [m^3]",)),
    "span_breath": Note(
        "volume of the air between the discs and its rate",
        ("volume [m^3]", "volume_rate [m^3/s]"),
    ),
    "span_jacobian": Note("derivatives of the forces between discs", _JACOBIAN),
    "rim_touches": Note(
        "contact of the disc's rim: distance, place and force of each point, root frame",
        ("gap [m]", "place [m]", "force [N]"),
    ),
    "world_wrench": Note("forces of the world on the disc, its frame", _LOAD),
    "world_slopes": Note("wrench of a unit of the forces' number, the disc's frame", _LOAD),
    "world_energy": Note("energy of the forces of the world on the disc", ("energy [J]",)),
    "world_jacobian": Note(
        "how the world's forces on the disc change, root frame",
        ("stiff [N/m, N, N m]", "drag [N s/m, N s, N m s]"),
    ),
    "root_step": Note(
        "disc in the root frame (eq (1), rates, accelerations), Table I and its derivatives",
        (
            "R [1]",
            "r [m]",
            "w [rad/s]",
            "v [m/s]",
            "alpha [rad/s^2]",
            "a [m/s^2]",
            "axis [1, m]",
            "axis_rate [1/s, m/s]",
            "axis_bias [1/s^2, m/s^2]",
        ),
    ),
    "composite_step": Note(
        "sums over the disc and all beyond it, root frame",
        (
            "inertia [kg m^2]",
            "h [kg m]",
            "mass [kg]",
            "K [kg m^2/s, kg m/s]",
            "P [N s]",
            "n [N m]",
            "f [N]",
            "stiff [N/m, N, N m]",
        ),
    ),
    "factors": Note(
        "products of the sums with the segment's axes",
        (
            "U [kg m^2, kg m]",
            "W [kg m^2/s]",
            "D [N m, N]",
            "Z [N m, N]",
            "Y [N m s, N s]",
        ),
    ),
    "power": Note("power of the loads on the disc", ("power [W]",)),
    "actuated": Note(
        "chamber pressures, and rates of the actuator's states",
        ("chamber [Pa]", "state_rate [unit of the state/s]"),
    ),
    "observed": Note(
        "what happens in the chambers, and the actuator's energies",
        (
            "chamber [Pa]",
            "supply_flow [kg/s]",
            "exhaust_flow [kg/s]",
            "leak_flow [kg/s]",
            "stored_energy [J]",
            "supplied_power [W]",
            "dissipated_power [W]",
        ),
    ),
    "felt_by_chip": Note(
        "angular rate and specific force along the chip's axes", ("felt [rad/s, m/s^2]",)
    ),
    "place_of": Note("position of a point of the disc in the root frame", ("place [m]",)),
    "distance_of": Note("distance of two points", ("distance [m]",)),
    "mass_block": Note("eq (6), block of the mass matrix", ("M [kg m^2]",)),
    "diagonal_blocks": Note("derivatives of inverse dynamics, diagonal block", _JACOBIAN),
    "lower_blocks": Note("derivatives of inverse dynamics, block below", _JACOBIAN),
    "upper_blocks": Note("derivatives of inverse dynamics, block above", _JACOBIAN),
    "drag_blocks": Note("derivatives of forces that depend on rates", _JACOBIAN),
}
