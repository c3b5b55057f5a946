"""Settings of what is learned and how: data, without any learning library."""

import math
from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from snakebench.engines import load_engine
from snakebench.observation import STUDENT, TEACHER, columns
from snakebench.perturbation import Ranges, changed_robot, corner
from snakebench.policy import Card
from snakebench.reward import WEIGHTS
from snakebench.robot import Robot
from snakebench.scenario import Scenario
from snakebench.sources import code_digest
from snakebench.value import Count, Name, NonNegative, Positive, Value, digest

VISCOSITIES = (1e-7, 1e-2)  # [m^2/s] (paper; drawn log-uniformly is ours)
PHYSICS_RATE = 90  # of training [Hz]: targets held at 30 Hz swim as in the limit to 0.1 %

_PERTURBED = (  # modules of what is drawn, and of learning with it
    *("learning.perturbed", "learning.perturbed_distillation"),
    *("channel", "engines.perturbed", "perturbation"),
)


def _known(names: tuple[str, ...]) -> tuple[str, ...]:
    columns(names, 1)
    return names


def _ascending(bounds: tuple[float, float]) -> tuple[float, float]:
    if bounds[0] > bounds[1]:
        raise ValueError("an ascending range is needed")
    return bounds


Feels = Annotated[tuple[str, ...], Field(min_length=1), AfterValidator(_known)]
Range = Annotated[tuple[Positive, Positive], AfterValidator(_ascending)]
Share = Annotated[float, Field(ge=0, le=1)]
Units = tuple[Count, ...]


class Randomisation(Value):
    """What is drawn anew for each episode."""

    viscosities: Range = Field(VISCOSITIES, description="range, log-uniform [m^2/s]")
    pose: NonNegative = Field(0.0, description="standard deviation of the first joint angles [rad] (ours)")
    mass: Share = Field(0.0, description="largest relative change of all masses, uniform (ours)")
    diameter: Share = Field(0.0, description="largest relative change of the diameter, uniform (ours)")
    prices: Range | None = Field(None, description="price of power if preference-conditioned, log-uniform [1/W] (ours)")
    perturbations: Ranges = Field(
        {}, exclude_if=lambda ranges: not ranges, description="of the robot, by name, each uniform in its range (ours)"
    )

    @model_validator(mode="after")
    def _servos_are_limited_or_not(self) -> Self:
        low, high = self.perturbations.get("speed_limit", (1.0, 1.0))
        if low == 0 < high:
            raise ValueError(f"perturbations: speed_limit = {[low, high]}: 0 is no limit, begin the range above it")
        return self

    def __hash__(self) -> int:
        return hash(self.model_dump_json())


class Swimming(Value):
    """In what a policy learns, and the sizes of its network."""

    robot: Robot = Field(default_factory=Robot)
    control_rate: Count = Field(30, description="actions per second [Hz]")
    duration: Positive = Field(30.0, description="length of an episode [s] (paper)")
    randomisation: Randomisation = Field(default_factory=Randomisation)
    feels: Feels = Field(STUDENT, description="what the actor observes: groups, or quantities of them")
    mlp: Units = Field((64, 64), description="units of each hidden layer, ELU (paper)")
    lstm: Units = Field((128, 128), description="units of each LSTM layer (paper); none for no memory")

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        prices, conditioned = self.randomisation.prices, not {"preference", "price of power"}.isdisjoint(self.feels)
        if conditioned and prices is None:
            raise ValueError("a preference-conditioned policy needs randomisation.prices, the range of its prices")
        if prices and not (conditioned and prices[0] < prices[1]):
            raise ValueError(f"prices = {list(prices)}: an ascending range is needed, and a policy that observes it")
        if len(set(self.lstm)) > 1:
            raise ValueError(f"lstm = {list(self.lstm)}: layers of one size are needed")
        _, farthest = self.randomisation.perturbations.get("dead_joint", (0, 0))
        if farthest > self.robot.n_joints or (farthest and not self.robot.proportional_gain):
            n = self.robot.n_joints
            needed = "a joint of the robot is needed, and a proportional_gain above 0"
            raise ValueError(f"perturbations: dead_joint up to {farthest:g}, of {n} joints: {needed}")
        return self

    def digest(self) -> str:
        """A hash of the settings, and of the code of perturbations where there are any."""
        own = super().digest()
        return digest([own, code_digest(*_PERTURBED)]) if self.randomisation.perturbations else own

    def scenario(self) -> Scenario:
        """Where it learns, in water: planar, at the lowest multiple of the control rate that is no less than 90 Hz.

        It is higher where a perturbed robot needs it: joints are stiffest with light links and strong, slow servos.
        """
        ranges, needed = self.randomisation.perturbations, float(PHYSICS_RATE)
        if ranges:
            stiffest = changed_robot(self.robot, corner(ranges, "mass", "speed_limit"))
            needed = max(needed, load_engine("planar").stable_rate(stiffest, "angle"))
        rate = math.ceil(needed / self.control_rate) * self.control_rate
        where = {"robot": self.robot, "control_rate": self.control_rate, "duration": self.duration}
        return Scenario(**where, engine="planar", physics_rate=rate)

    def card(self, **origin: str | int | float) -> Card:
        """What a policy with these settings is made for."""
        network = self.model_dump(include={"control_rate", "feels", "mlp", "lstm"})
        return Card(joints=self.robot.n_joints, prices=self.randomisation.prices, origin=origin, **network)


class Training(Swimming):
    """Reinforcement learning by PPO; what the paper states is so by default."""

    feels: Feels = Field(TEACHER, description="what the actor observes: groups, or quantities of them")
    critic: Feels = Field(TEACHER, description="what the critic observes")
    critic_lstm: bool = Field(True, description="whether the critic of an actor with memory has its own (paper)")
    steps: Count = Field(description="control steps of all members together")
    members: Count = Field(64, description="environments side by side (ours)")
    rollout: Count = Field(96, description="control steps between updates; the gradient's length (ours; usual are 24)")
    checkpoints: Count = Field(20, description="rows of the log, each with a checkpoint")
    learning_rate: Positive = Field(1e-3, description="at first (paper); it adapts")
    kl: Positive = Field(
        0.01, description="change of the policy per update aimed at; the value is that of RSL-RL (of the paper)"
    )
    clip: Positive = Field(0.2, description="of the ratio of probabilities (paper)")
    discount: Share = Field(0.99, description="gamma (paper)")
    trace: Share = Field(0.95, description="lambda of the advantage estimate (paper)")
    epochs: Count = Field(5, description="passes over each rollout (paper)")
    minibatches: Count = Field(4, description="per pass (paper)")
    entropy: NonNegative = Field(0.0, description="coefficient of the entropy bonus (ours)")
    value: Positive = Field(1.0, description="coefficient of the value loss, as in RSL-RL (of the paper)")
    gradient: Positive = Field(1.0, description="largest norm of a gradient, as in RSL-RL (of the paper)")
    spread: Positive = Field(0.5, description="standard deviation of the actions at first [rad] (ours)")
    propulsion: NonNegative = Field(WEIGHTS.propulsion, description="the reward's w_1 at first [s/m]")
    growth: Share = Field(0.0, description="share of the training in which w_1 grows to 10, linearly")
    price_growth: Share = Field(0.0, description="share in which the highest price grows from the lowest, log-linearly")

    @property
    def all_steps(self) -> int:
        """Control steps of all members together."""
        return self.steps

    @model_validator(mode="after")
    def _curricula_take_time(self) -> Self:
        if self.propulsion != WEIGHTS.propulsion and not self.growth:
            raise ValueError(f"propulsion = {self.propulsion:g}: it needs growth, without which w_1 is always 10")
        if self.price_growth and not self.randomisation.prices:
            raise ValueError(f"price_growth = {self.price_growth:g}: there are no randomisation.prices")
        return self

    @model_validator(mode="after")
    def _minibatches_have_steps(self) -> Self:
        if self.members * self.rollout < 2 * self.minibatches:
            raise ValueError(f"minibatches = {self.minibatches}: too many for {self.members * self.rollout} steps")
        return self


class Imitating(Swimming):
    """A student imitates what a teacher would do, on the states that the two of them visit."""

    feels: Feels = Field(STUDENT, description="what the student observes: groups, or quantities of them")
    iterations: Count = Field(400, description="rollouts with updates (paper's table; its text says 600)")
    rollout: Count = Field(200, description="control steps of each, the gradient's length (paper)")
    members: Count = Field(64, description="environments side by side (ours)")
    groups: Count = Field(4, description="minibatches that the members are split into (ours; the paper's figure is 1)")
    passes: Count = Field(2, description="over each rollout (ours; the paper's figure is 1)")
    handover: int = Field(120, ge=0, description="iterations until the student drives alone (ours; the paper's is 0)")
    learning_rate: Positive = Field(5e-4, description="of Adam (paper)")
    decay: Share = Field(0.0, description="last share of the iterations, in which the learning rate falls to 0 (ours)")
    checkpoints: Count = Field(20, description="rows of evaluations, each with a checkpoint")

    @property
    def all_steps(self) -> int:
        """Control steps of all members together."""
        return self.iterations * self.rollout * self.members

    @model_validator(mode="after")
    def _groups_have_members(self) -> Self:
        if self.groups > self.members:
            raise ValueError(f"groups = {self.groups}: too many for {self.members} members")
        return self


class Distillation(Imitating):
    """The teacher is a policy: its mean action is imitated."""

    teacher: Name = Field(description="name of the policies to imitate, each seed that of the same seed")


class Imitation(Imitating):
    """The teacher is the limit of the body: its fastest gaits with held targets are demonstrations (ours)."""

    feels: Feels = Field(("sensors", "preference"), description="what the student observes")
    demonstrations: Name = Field(description="study of the limit whose gaits are imitated, those of held targets")
    currency: Literal["net", "positive"] = Field("net", description="of power: net is P, positive is P+")
    lost: Positive = Field(
        0.15, description="recent squared error at which the teacher drives alone; from half of it on it helps [rad^2]"
    )
    groups: Count = Field(8, description="minibatches that the members are split into")
    passes: Count = Field(4, description="over each rollout")
    learning_rate: Positive = Field(1e-3, description="of Adam, at first")
    decay: Share = Field(0.4, description="last share of the iterations, in which the learning rate falls to 0")


class Scheduling(Swimming):
    """A gain schedule: it estimates the viscosity and plays the limit's fastest gait for it, with held targets (ours).

    `randomisation.viscosities` chooses the gaits; the estimator learns from 1e-7 to 1e-2 m^2/s.
    """

    checkpoints: ClassVar[int] = 1  # the row of its log
    feels: Feels = Field(("sensors", "preference"), description="what it observes, which is no choice")
    demonstrations: Name = Field(description="study of the limit whose gaits are played, those of held targets")
    currency: Literal["net", "positive"] = Field("net", description="of power: net is P, positive is P+")
    estimator: Count = Field(description="steps of the regression of its estimator of the viscosity")

    @model_validator(mode="after")
    def _has_no_other_settings(self) -> Self:
        useless = {"feels", "mlp", "lstm"} & self.model_fields_set
        useless |= {f"randomisation.{name}" for name in self.randomisation.model_fields_set - {"viscosities", "prices"}}
        if useless:
            raise ValueError(f"{min(useless)}: a gain schedule has no such setting")
        return self

    @property
    def all_steps(self) -> int:
        """Steps of the regression."""
        return self.estimator

    def digest(self) -> str:
        """A hash of the settings and of the code of schedule and estimator."""
        code = code_digest("gain_schedule", "learning.estimator", "learning.schedule")
        return digest([super().digest(), code])
