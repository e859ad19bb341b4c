"""The robot of a scene as it really is, where that is not what its model says."""

from dataclasses import replace

from .actuators import Hysteresis, actuator_of
from .forces import Payload
from .scene import Scene


def truth_scene(scene: Scene) -> Scene:
    """The scene with the robot as it really is: see the fields `truth_...` of `Estimation`.

    Raises:
        SceneError: it cannot be cut into other discs.
    """
    choice = scene.estimation
    if choice is None:
        return scene
    if choice.truth_discs:
        share = ((choice.disc or scene.robot.n_discs) - 1) / (scene.robot.n_discs - 1)
        scene = scene.rediscretised(choice.truth_discs)
        scene = replace(
            scene, estimation=replace(choice, disc=1 + round(share * (choice.truth_discs - 1)))
        )
    robot, options = scene.robot, dict(scene.options)
    stiffer = (replace(s, stiffness=choice.truth_stiffness * s.stiffness) for s in robot.springs)
    if choice.truth_hysteresis:
        source = actuator_of(options.get("actuator", "direct"))
        options["actuator"] = Hysteresis(source, amplitude=choice.truth_hysteresis)
    forces = robot.forces
    if choice.truth_payload:
        forces = (*forces, Payload(robot.n_discs, choice.truth_payload))
    robot = replace(robot, springs=tuple(stiffer), forces=forces)
    return replace(scene, robot=robot, options=options)
