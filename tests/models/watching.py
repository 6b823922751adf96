"""Updates of the ground truth after a physics step, for tests without a simulation."""

from wayproof.models.step_kernels import touched


def watch(truth, data, base):
    """Count what the robot touches now."""
    truth.places[truth.steps % len(truth.places)] = data.xpos[base]
    truth.end_step(touched(data.contact.geom, truth.is_robot, truth.is_obstacle))
