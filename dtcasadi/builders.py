"""The builders of a model's Functions by name."""

from . import functions, jacobians

BUILDERS = {
    name: getattr(functions, name)
    for name in (
        "mass_matrix",
        "coriolis",
        "gravity",
        "spring",
        "damping",
        "inflation",
        "volume",
        "forces",
        "contacts",
        "forward_dynamics",
        "multipliers",
        "constraint_terms",
        "inverse_dynamics",
        "thread_tension",
        "poses",
        "angular_jacobians",
        "kinetic_energy",
        "potential_energy",
        "momenta",
        "lagrangian_gradient",
        "canonical_ode",
        "ode",
        "air",
        "power",
    )
} | {
    name: getattr(jacobians, name)
    for name in ("inverse_dynamics_jacobian", "forward_dynamics_jacobian", "ode_jacobian")
}
# Names of a model's Functions.
FUNCTIONS = tuple(BUILDERS)
