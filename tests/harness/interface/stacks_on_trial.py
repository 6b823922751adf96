"""Stacks of a user's own: a good one, and one for each way to be broken."""

import dataclasses
import json

import numpy as np

from wayproof.harness.interface.local_costmap import config_of, inputs_of
from wayproof.harness.interface.motion import trajectory_of
from wayproof.harness.interface.stacks.blind import Blind
from wayproof.harness.interface.types import Command, Grid, Samples, Velocity, Waypoints
from wayproof.harness.stack.build import build_navigator
from wayproof.harness.stack.planner_input import motion_limits


class Base:
    def start(self, task):
        self.task = task

    def close(self):
        pass


class Ahead(Base):
    """Drives straight on, slowly."""

    def step(self, observation):
        return Command(Velocity(0.3), reason="on and on", scalars={"n": observation.sequence})


class Maps(Base):
    """Stands, and gives a costmap of 2 x 1 m that rolls with it, each third time."""

    def step(self, observation):
        cells = np.zeros((10, 20), np.int8)
        cells[:, 15:] = -1
        cells[:, 10:15] = 50
        cells[:5, :5] = 100
        grid = Grid(observation.position[:2] - (1.0, 0.5), 0.1, cells)
        return Command(Velocity(0.0), costmap=None if observation.sequence % 3 else grid)


class ToWaypoint(Base):
    def step(self, observation):
        goal = np.array(self.task.mission.goal)
        return Command(Waypoints(goal[None], 0.5), planned_path=goal[None])


class ToGoalAtFullSpeed(Base):
    def step(self, observation):
        return Command(Waypoints(np.array([self.task.mission.goal])))


class ToTheWall(Base):
    """Flies to 5 cm from where the wall at the least x ends its area, and rests there."""

    def start(self, task):
        self.mission = task.mission

    def step(self, observation):
        here = np.array(observation.reference.position)
        x = self.mission.low[0] + self.mission.radius + 0.15
        return Command(Waypoints(np.array([here, [x, *here[1:]]])))


class Lands(Base):
    """Lands on its way, and gives up there."""

    def step(self, observation):
        here = np.array(observation.reference.position)
        if observation.sequence > 25:
            return Command(action="abort", reason="battery low")
        return Command(Waypoints(np.array([here, [*here[:2], 0.08]])))


class Breaks(Base):
    """Answers well three times, and then as `broken` does."""

    def step(self, observation):
        return self.broken() if observation.sequence == 3 else Command(Velocity(0.2))


class Raises(Breaks):
    def broken(self):
        raise KeyError("map")


class RaisesInStart(Ahead):
    def start(self, task):
        raise FileNotFoundError("weights.bin")


class RaisesInClose(Ahead):
    def close(self):
        raise OSError("no tidying up")


class RaisesInBoth(RaisesInStart, RaisesInClose):
    """Raises in `start`, and then in `close`."""


class Nan(Breaks):
    def broken(self):
        return Command(Velocity(float("nan")))


class Elsewhere(Base):
    def step(self, observation):
        start = observation.reference.position + np.array([3.0, 0.0, 0.0])
        positions = np.array([start, start + np.array([0.1, 0.0, 0.0])])
        if observation.sequence < 3:
            return Command(Velocity(0.0))
        return Command(Samples(0.1, positions, np.zeros(2)))


class Garbage(Breaks):
    def broken(self):
        return "go"


class Random(Base):
    """Uses a generator without a seed."""

    def step(self, observation):
        return Command(Velocity(0.2 + 0.01 * np.random.default_rng().random()))


class ClaimsInMotion(Base):
    def step(self, observation):
        return Command(Velocity(0.5), "goal")


class BuiltinStack:
    """The built-in stack behind the interface, with no way in that others lack."""

    def start(self, task):
        config = config_of(task)
        self._deadline_s, self._planar = task.deadline_s, task.mission.planar
        self._limits = motion_limits(config, task.mission)
        beams = {name: sensor.beams for name, sensor in task.sensors.items()}
        self._navigator = build_navigator(config, task.mission, beams)

    def step(self, observation):
        navigator = self._navigator
        if observation.last is not None:
            self._commit_last(observation)
        self._decision = navigator.step(inputs_of(observation))
        trajectory = navigator.draft.trajectory
        path = navigator.draft.global_path
        return Command(
            trajectory,
            self._decision.action,
            self._decision.label,
            self._decision.reason,
            path,
            self._decision.map_version,
        )

    def close(self):
        pass

    def _commit_last(self, observation):
        navigator, last = self._navigator, observation.last
        late = last.fate == "late"
        navigator.commit(self._decision, 2.0 * self._deadline_s if late else 0.0)
        if last.fate == "cut":  # the body brakes to rest, from where it is commanded to be
            reference = observation.reference
            position = navigator.mapper.planning_point(reference.position)
            reference = dataclasses.replace(reference, position=position)
            brake = trajectory_of(
                Velocity(0.0, duration_s=0.0),
                (reference, reference),
                observation.effect_ns,
                self._limits,
                planar=self._planar,
            ).trajectory
            state = dataclasses.replace(navigator.state, committed=(brake,), route=None)
            navigator.load_state(state, navigator.chain)


class Daring(BuiltinStack):
    """The built-in stack with hardly a margin, whatever the settings say."""

    def start(self, task):
        settings = json.loads(task.settings)
        settings["costmap"]["localization_margin"] = 0.0
        settings["costmap"]["unknown_policy"] = "allow"
        super().start(dataclasses.replace(task, settings=json.dumps(settings)))


class OfSeed0(BuiltinStack):
    """The built-in stack, which draws as by the seed of the world."""

    SEED = 0

    def start(self, task):
        super().start(dataclasses.replace(task, seed=self.SEED))


class OfSeed1(OfSeed0):
    SEED = 1


class OfSeed2(OfSeed0):
    SEED = 2


class Straight(Blind):
    """Drives straight at the goal, and says that it plans to."""

    def step(self, observation):
        line = np.linspace(observation.reference.position, self._task.mission.goal, 5)
        return dataclasses.replace(super().step(observation), planned_path=line)


class TooFast(Base):
    """Asks for twice the greatest speed of the body, and a dead stop."""

    def step(self, observation):
        speed, now = 2.0 * self.task.mission.max_speed, observation.reference
        ahead = np.array([np.cos(now.heading), np.sin(now.heading), 0.0])
        steps = np.outer(np.minimum(np.arange(9), 6) * 0.1 * speed, ahead)
        return Command(Samples(0.1, now.position + steps, np.full(9, now.heading)))


class Overwrites(Ahead):
    """Writes to the ranges that it observes, as careless code does."""

    def step(self, observation):
        if observation.sequence == 3:
            observation.sweeps[0].ranges_mm[:] = 65535
        return super().step(observation)


class Moves(Ahead):
    """Writes to the position that it observes."""

    def step(self, observation):
        if observation.sequence == 3:
            position = observation.position
            position += 5.0
        return super().step(observation)


class BlindsItsReferee(Ahead):
    """Writes to all that it can reach from the ranges that it observes."""

    def step(self, observation):
        for sweep in observation.sweeps:
            for array in (sweep.ranges_mm, sweep.ranges_mm.base, *sweep.place.args[:1]):
                array = getattr(array, "ranges_mm", array)
                if array is not None:
                    array.setflags(write=True)
                    array[:] = 65535
        return super().step(observation)


class JudgesItself(Base):
    """Replaces the judge where it finds one, and drives blindly at the goal."""

    def start(self, task):
        import wayproof.harness.interface.trial as trial

        super().start(task)
        judge = trial.judge
        trial.judge = lambda *a: dataclasses.replace(judge(*a), verdict="admitted")

    def step(self, observation):
        away = observation.goal - observation.position
        speed = self.task.mission.max_speed
        return Command(Velocity(speed, yaw_rate=np.arctan2(away[1], away[0])))
