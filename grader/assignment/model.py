"""The models of ``assignment.yaml``.

Their docstrings and field descriptions are the documentation of the YAML; ``make docs``
renders them.
"""

from __future__ import annotations

from enum import Enum
from typing import Any, Literal

from pydantic import ConfigDict, Field, PrivateAttr, model_validator

from grader.assignment.bag import BagOptions
from grader.assignment.contract.model import Contract
from grader.assignment.limits import BuildLimitOptions, LimitOptions
from grader.assignment.stimuli.stimulus import Stimulus
from grader.assignment.true_motion import TrueMotion
from grader.assignment.variable import Variable
from grader.checks.window import Phase, Window
from grader.findings.words import Words
from grader.spec.name import (
    BuildTypes,
    Durability,
    Id,
    InterfaceName,
    LibraryName,
    Namespace,
    NodeName,
    PackageName,
    Reliability,
    TopicName,
)
from grader.spec.quantity import Duration, DurationOrZero, PositiveLength, Ratio
from grader.spec.source import Model
from grader.spec.unit import parse_any
from sim.camera_options import CameraOptions
from sim.description import (
    LidarOptions,
    OdometryOptions,
    OdometryTopic,
    RobotOptions,
    ScanTopic,
    SimulatorOptions,
    Topics,
    TransformTopic,
)
from sim.sensor_options import BatteryOptions, ImuOptions, JointOptions, RangeOptions
from sim.turtles.interfaces import commands


class RandomRange(Model):
    """Bounds of a random value; both with the same unit, or both without."""

    model_config = ConfigDict(frozen=True)

    low: float
    high: float
    unit: str = ""

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> dict[str, Any]:
        """Describe it to an editor as it is written: [lowest, highest]."""
        entry = {"type": ["number", "string"]}
        return {"type": "array", "items": entry, "minItems": 2, "maxItems": 2}

    @model_validator(mode="before")
    @classmethod
    def _read(cls, value: Any) -> Any:
        if isinstance(value, RandomRange):
            return value
        if not isinstance(value, list | tuple) or len(value) != 2:
            raise ValueError(
                "a random value is written as [lowest, highest]; one that is the same in every run "
                "stands under 'values'"
            )
        (low, unit), (high, other) = parse_any(value[0]), parse_any(value[1])
        if unit != other:
            raise ValueError(f"the bounds {value[0]!r} and {value[1]!r} have different units")
        if low > high:
            raise ValueError(f"the lowest value {value[0]!r} is above the highest, {value[1]!r}")
        return {"low": low, "high": high, "unit": unit}


class FixedValue(Model):
    """A number, in SI units where it has a unit."""

    number: int | float
    unit: str = ""

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> dict[str, Any]:
        """Describe it to an editor as it is written."""
        return {"type": ["number", "string"]}

    @model_validator(mode="before")
    @classmethod
    def _read(cls, value: Any) -> Any:
        if isinstance(value, FixedValue):
            return value
        number, unit = parse_any(value)
        # A parameter of the type integer takes no 3.0.
        return {"number": value if isinstance(value, int) else number, "unit": unit}


ODOMETRY = "nav_msgs/msg/Odometry"
LASER_SCAN = "sensor_msgs/msg/LaserScan"
TRANSFORMS = "tf2_msgs/msg/TFMessage"


class Visibility(str, Enum):
    """When a student gets to see a check."""

    VISIBLE = "visible"
    AFTER_DUE_DATE = "after_due_date"
    AFTER_PUBLISHED = "after_published"
    HIDDEN = "hidden"


SHOWN_FROM = tuple(Visibility)
"""Earliest first; the order in which students get to see checks."""


class Withheld(Model):
    """Number and points of the checks that a student does not see yet."""

    checks: int = Field(0, ge=0, description="Number of the checks.")
    points: float = Field(0.0, ge=0, description="Their points.")

    def __add__(self, other: Withheld) -> Withheld:
        """Both together."""
        return Withheld(checks=self.checks + other.checks, points=self.points + other.points)


NOTHING_WITHHELD = Withheld()
_IN_CPP = {"rclpy": "rclcpp", "tf2_ros_py": "tf2_ros"}
"""What takes the place of a package for Python in C++."""


class Package(Model):
    """A package that students hand in."""

    name: PackageName = Field(description="Name in package.xml.")
    build_types: BuildTypes = Field(
        ("ament_python",),
        alias="build_type",
        description="Build type exported by package.xml. With `[ament_python, ament_cmake]`, "
        "students choose between Python and C++.",
    )
    depends: tuple[str, ...] = Field(
        (),
        description="ROS packages that the solution needs; the starter package names them. If "
        "students may write C++, `rclpy` stands for `rclcpp` too, `tf2_ros_py` for `tf2_ros`, and "
        "others that begin with `rclcpp` are for C++ only.",
    )
    executables: tuple[str, ...] = Field(
        (), description="Executables that `ros2 run` must find in the package."
    )

    @property
    def build_type(self) -> str:
        """The build type of the reference solution and of the starter package."""
        return self.build_types[0]

    @property
    def depends_in_python(self) -> tuple[str, ...]:
        """What the solution needs in Python."""
        return tuple(name for name in self.depends if not name.startswith("rclcpp"))

    @property
    def depends_in_cpp(self) -> tuple[str, ...]:
        """What the solution needs in C++."""
        return tuple(_IN_CPP.get(name, name) for name in self.depends)


class Launch(Model):
    """A process to start like `ros2 run`, or a launch file to start like `ros2 launch`.

    Where ROS 2 comes from wheels, a launch file needs `underlays: [launch]`.
    """

    executable: str | None = Field(
        None,
        description="Name of the executable (entry point); optional if the contract has only one.",
    )
    file: str | None = Field(
        None,
        pattern=r"^[A-Za-z0-9_.-]+\.(py|xml|yaml|yml)$",
        description="Name of a launch file that the package installs, instead of an executable.",
    )
    package: PackageName | None = Field(
        None, description="Its package; optional if the assignment has only one."
    )
    name: NodeName | None = Field(None, description="Rename the node (`--ros-args -r __node:=`).")
    namespace: Namespace | None = Field(
        None, description="Namespace of the node (`--ros-args -r __ns:=`)."
    )
    parameters: dict[str, Any] = Field(
        default_factory=dict, description="Parameters (`--ros-args -p name:=value`)."
    )
    remap: dict[str, str] = Field(
        default_factory=dict, description="Remapping rules (`--ros-args -r from:=to`)."
    )
    arguments: tuple[str, ...] = Field(
        (),
        description="Arguments of the program; for a launch file `name:=value`. "
        "`$(find-pkg-share course_files)` is the folder of an installed package, such as one in "
        "`packages/` beside assignment.yaml: `params_file:=$(find-pkg-share "
        "course_files)/config/slow.yaml`.",
    )
    after: DurationOrZero = Field(
        0.0,
        description="When it is started, counted from the start of the scenario. At least one of "
        "its processes is started at once.",
    )

    @model_validator(mode="after")
    def _one_thing(self) -> Launch:
        if (self.executable is None) == (self.file is None):
            raise ValueError("give either an 'executable' or a launch 'file'")
        if self.file is not None:
            of_nodes = {"name", "namespace", "parameters", "remap"} & self.model_fields_set
            if of_nodes:
                keys = ", ".join(sorted(of_nodes))
                raise ValueError(
                    f"a launch file says itself how its nodes start: leave out {keys}, and give "
                    "its 'arguments'"
                )
        return self

    @property
    def program(self) -> str:
        """The executable or the launch file."""
        return self.executable or self.file or ""


class AuthorSimulator(Launch, TrueMotion):
    """A simulator of the author's, with one robot, in place of rosgrade's own.

    It is started before the student's programs, as companions are.
    """

    package: PackageName = Field(
        description="Its package: in `packages/` beside assignment.yaml, in an underlay or of ROS."
    )

    @property
    def options(self) -> SimulatorOptions:
        """Its robot's topics, in the words of rosgrade's own simulator."""
        return SimulatorOptions(
            lidar=LidarOptions(enabled=self.scan is not None),
            odometry=OdometryOptions(enabled=self.odometry is not None),
            topics=Topics(
                command=self.command,
                odometry=self.odometry or OdometryTopic(),
                scan=self.scan or ScanTopic(),
                tf=TransformTopic(enabled=False),
            ),
        )


class RecordedTopic(Model):
    """A topic that the probe subscribes to, with the QoS that the probe requests."""

    topic: TopicName = Field(description="Fully qualified topic name.")
    type: InterfaceName = Field(
        description="Interface, such as geometry_msgs/msg/Twist. If students write its package, "
        "put your own copy of the package into the folder `interfaces` beside "
        "assignment.yaml. The feedback of an action is on its topic `/fibonacci/_action/feedback` "
        "with the type example_interfaces/action/Fibonacci_FeedbackMessage."
    )
    reliability: Reliability = Field(
        "reliable",
        description="Requested reliability. A publisher that does not match it is still "
        "recorded through a second, best-effort subscription.",
    )
    durability: Durability = Field("volatile", description="Requested durability.")
    depth: int = Field(100, ge=1, le=10_000, description="Queue depth of the probe.")


class Until(Model):
    """When the observation may end early: as soon as all of these conditions are true.

    `elapsed` and `quiet` count from the first match of an endpoint, not from the launch. So a slow
    start costs no points.
    """

    messages: int | None = Field(
        None, ge=1, description="Number of messages on every recorded topic."
    )
    quiet: Duration | None = Field(
        None,
        description="Time without a message on any recorded topic or from a stimulus that has an "
        "end. Every declared timer must have had time to fire.",
    )
    elapsed: Duration | None = Field(None, description="Time since the first match.")
    at_rest: Duration | None = Field(
        None, description="Time at rest of the simulated robot or turtles, after they have moved."
    )
    travelled: PositiveLength | None = Field(
        None,
        description="Distance that the simulated robot has driven, along its path; of turtles the "
        "one that went the farthest.",
    )
    stimuli: Literal["done"] | None = Field(
        None,
        description="`done`: every stimulus that has an end is complete, and each of its answers "
        "has come or timed out.",
    )
    any: tuple[Until, ...] = Field((), description="At least one of these is true.")


class Scenario(Model):
    """One run: what is launched, what is recorded, and when it ends. Or a bag that is read."""

    id: Id = Field(description="Short name, unique in the assignment.")
    title: str = Field("", description="What happens in the run, for the report.")
    repeat: int = Field(
        1,
        ge=1,
        le=10,
        description="How many times it is run, each time with other random values. The runs of "
        "`drive` are called `drive_1`, `drive_2`, ... See `counts` of the checks.",
    )
    launch: tuple[Launch, ...] = Field((), min_length=1, description="Processes of the student.")
    bag: BagOptions | None = Field(
        None,
        description="In place of `launch`: nothing is run, and a bag of the submission is judged. "
        "`record` says which of its topics. Of `robot`, the limits, the `radius` and the `pose` "
        "at the beginning count, and of `topics`, `command` and `odometry`.",
    )
    companions: tuple[Launch, ...] = Field(
        (),
        description="Programs of the author's, each an executable or a launch file of a package in "
        "`packages/` beside assignment.yaml. They start before the student's and run as long, and "
        "nothing of theirs is judged: a traffic light, another robot.",
    )
    simulator: AuthorSimulator | None = Field(
        None,
        description="A simulator of your own, such as Gazebo, in place of a `world`. See "
        "[other robots](other-robots.md#a-simulator-of-your-own).",
    )
    record: tuple[RecordedTopic, ...] = Field((), description="Topics to record.")
    stimuli: tuple[Stimulus, ...] = Field(
        (), description="What the probe sends or does during the run."
    )
    world: str | None = Field(
        None,
        description="World file, relative to the assignment's folder. A world adds a simulated "
        "robot to the scenario, or turtles. Its topics are recorded too, and the `cmd_vel` of each "
        "of its turtles. Simulated time begins at the first match. The run ends 1 s after a "
        "contact of the robot.",
    )
    robot: RobotOptions = Field(default_factory=RobotOptions, description="The simulated robot.")
    robots: dict[NodeName, RobotOptions] = Field(
        default_factory=dict,
        max_length=8,
        description="Several robots instead of one: name -> what `robot` has, such as `{tb1: "
        "{pose: [0, 0, 0]}, tb2: {pose: [1, 0, 0]}}`. The topics and frames of each begin with its "
        "name: `/tb1/cmd_vel`, `tb1/odom`; all transforms are on `/tf`. They see and touch each "
        "other. Sensors and topics are the same for all. Checks of motion say which `robot` they "
        "judge.",
    )
    lidar: LidarOptions = Field(default_factory=LidarOptions, description="Its LiDAR.")
    odometry: OdometryOptions = Field(
        default_factory=OdometryOptions, description="Its wheel odometry."
    )
    imu: ImuOptions | None = Field(
        None, description="Its IMU. By default it has none; `imu: {}` is one."
    )
    joint_states: JointOptions | None = Field(
        None, description="Its wheel joints; `joint_states: {}` publishes them."
    )
    battery: BatteryOptions | None = Field(None, description="Its battery; `battery: {}` is one.")
    ranges: tuple[RangeOptions, ...] = Field(
        (), description="Its distance sensors, such as sonars."
    )
    camera: CameraOptions | None = Field(
        None, description="Its camera. By default it has none; `camera: {}` is one."
    )
    topics: Topics = Field(default_factory=Topics, description="Its topics with their QoS.")
    random: dict[Id, RandomRange] = Field(
        default_factory=dict,
        description="Random values: name -> [lowest, highest], evenly distributed, from the "
        "scenario's seed. `$name` stands for the value in the world file and in the parameters "
        "of `launch`; checks name it without the dollar sign.",
    )
    values: dict[Id, FixedValue] = Field(
        default_factory=dict,
        description="Values that are the same in every run, such as `{goal_x: 0.5}` or `{wall: "
        "60 cm}`, to say them once. They are named like those of `random`.",
    )
    until: Until = Field(default_factory=Until, description="When to end early.")
    timeout: Duration = Field(
        description="End of the observation, counted from the first match. What a bag has later, "
        "counted from its first message, is not judged."
    )
    discovery: Duration = Field(
        10.0,
        description="Longest time until the first node appears, without delays of the machine.",
    )
    shutdown: DurationOrZero = Field(
        2.0, description="Time from SIGINT until a node that still runs gets SIGTERM."
    )
    limits: LimitOptions | None = Field(
        None, description="Limits of the student's processes; by default the assignment's."
    )
    _turtles: tuple[str, ...] = PrivateAttr(())

    @property
    def turtles(self) -> tuple[str, ...]:
        """Names of the turtles in its world, which has no robot then."""
        return self._turtles

    def with_turtles(self, names: tuple[str, ...]) -> Scenario:
        """The same scenario, whose world was looked into."""
        copy = self.model_copy()
        copy._turtles = names
        return copy

    @property
    def transform_topics(self) -> dict[str, Durability]:
        """The robot's topics of transforms, if the scenario names them; with their durability."""
        tf = self.topics.tf
        is_named = "tf" in self.topics.model_fields_set and tf.enabled
        if not is_named or not self.simulated_robots:
            return {}
        return {tf.topic: tf.durability, tf.static_topic: "transient_local"}

    @property
    def camera_topics(self) -> set[str]:
        """The topics of the robots' cameras; only what `record` names is recorded of them."""
        cameras = (robot.camera for robot in self.simulated_robots.values())
        return {topic for camera in cameras if camera is not None for topic in camera.topics}

    @property
    def simulation(self) -> SimulatorOptions:
        """Everything about rosgrade's simulator but the world and the names of several robots."""
        return SimulatorOptions(
            **{key: getattr(self, key) for key in SimulatorOptions.model_fields}
        )

    @property
    def simulated_robots(self) -> dict[str, SimulatorOptions]:
        """The robots in its world by name; where there is only one, its name is empty."""
        if self.simulator is not None:
            return {"": self.simulator.options}
        has_robots = self.world is not None and not self.turtles
        return self.simulation.each(self.robots) if has_robots else {}

    @property
    def has_robot(self) -> bool:
        """Whether a robot's motion is known: a simulated one's, or by the odometry in a bag."""
        return bool(self.simulated_robots) or (self.bag is not None and self.odometry.enabled)

    @property
    def recorded_types(self) -> dict[str, str]:
        """Topic -> type of all that is recorded: `record`, and the robot's topics."""
        types = dict.fromkeys(self.transform_topics, TRANSFORMS)
        types |= commands(self.turtles)
        types |= {recorded.topic: recorded.type for recorded in self.record}
        if self.bag is not None and self.has_robot:
            types.setdefault(self.topics.command.topic, self.topics.command.type)
            types[self.topics.odometry.topic] = ODOMETRY
        for robot in self.simulated_robots.values():
            types.setdefault(robot.topics.command.topic, robot.topics.command.type)
            if robot.odometry.enabled:
                types[robot.topics.odometry.topic] = ODOMETRY
            if robot.lidar.enabled:
                types[robot.topics.scan.topic] = LASER_SCAN
            types |= {sensor.topic: sensor.interface for sensor in robot.sensors}
        return types


class Counts(str, Enum):
    """Which finding counts where a check judges several scenarios."""

    WORST = "worst"
    BEST = "best"
    MEDIAN = "median"
    MEAN = "mean"


class Partial(Model):
    """Parameters with which a check that fails gives a share of its points."""

    share: Ratio = Field(description="Share of the points, such as `75 %`.")
    with_: dict[str, Any] = Field(
        alias="with",
        description="Parameters that differ from those of the check, such as `{position: 10 cm}`.",
    )

    @model_validator(mode="after")
    def _below_all(self) -> Partial:
        if self.share >= 1.0:
            raise ValueError("the share is below 100 %: all points need the check's own parameters")
        return self


class CheckSpec(Model):
    """A check with its points."""

    id: Id = Field(description="Short name, unique in the assignment.")
    title: str = Field(
        "", description="One line for the student; by default the title of the check."
    )
    uses: str | None = Field(None, description="Name of a check in the catalogue.")
    python: str | None = Field(
        None, description="An own check: `file.py:function`, beside assignment.yaml."
    )
    with_: dict[str, Any] = Field(
        default_factory=dict, alias="with", description="Parameters of the check."
    )
    scenarios: tuple[Id, ...] = Field(
        (),
        description="Scenarios whose recordings it judges; by default all, but a bag only where "
        "nothing is run. Checks of a submission have no scenarios.",
    )
    counts: Counts = Field(
        Counts.WORST,
        description="Which of several scenarios or runs counts: the `worst`, the `best`, the "
        "`median`, or the `mean` of them, which gives points for each.",
    )
    after: Phase | None = Field(
        None, description="Judge only what is observed after this has happened first."
    )
    before: Phase | None = Field(
        None, description="Judge only what is observed before this happens first."
    )
    while_: Phase | None = Field(
        None,
        alias="while",
        description="Judge only what is observed while this is so: each time of it by itself.",
    )
    from_: DurationOrZero = Field(
        0.0,
        alias="from",
        description="Judge only what is observed from then on, counted from the first match, or "
        "from the beginning of what `after` or `while` names.",
    )
    to: Duration | None = Field(
        None, description="Judge only what is observed until then, counted from the same."
    )
    robot: NodeName | None = Field(
        None, description="Judge this one of the `robots` of the scenario; others are obstacles."
    )
    points: float = Field(ge=0, description="Points for passing.")
    partial: tuple[Partial, ...] = Field(
        (), description="Looser parameters that give a share of the points if the check fails."
    )
    requires: tuple[Id, ...] = Field(
        (), description="Checks that must pass; otherwise this check is skipped."
    )
    hint: str | Words | tuple[str | Words, ...] = Field(
        "",
        description="What to try if the check fails, in the author's words; where Python and C++ "
        "differ, `{python: ..., cpp: ...}`. Or steps in a list, from a nudge to nearly the answer, "
        "of which a student asks for each after the first.",
    )
    visibility: Visibility = Field(Visibility.VISIBLE, description="When students see the check.")

    @model_validator(mode="after")
    def _one_check(self) -> CheckSpec:
        if (self.uses is None) == (self.python is None):
            raise ValueError("give either 'uses', a check of the catalogue, or 'python', your own")
        if self.to is not None and self.to <= self.from_:
            raise ValueError("'to' is not later than 'from'")
        return self

    @property
    def hints(self) -> tuple[str | Words, ...]:
        """The steps of the hint; none where there is no hint."""
        steps = self.hint if isinstance(self.hint, tuple) else (self.hint,)
        return tuple(filter(None, steps))

    @property
    def window(self) -> Window | None:
        """When it looks at a run; None for the whole run."""
        window = Window(self.after, self.before, self.while_, self.from_, self.to)
        return window if window != Window() else None


class Level(Model):
    """A level of a manual item, such as `{title: complete, points: 2}`."""

    title: str = Field(min_length=1)
    points: float = Field(ge=0)


class ManualItem(Model):
    """Points that a person gives, such as for a README or an oral exam; see `rosgrade review`."""

    id: Id = Field(description="Short name, unique in the assignment.")
    title: str = Field(min_length=1, description="One line for the student.")
    points: float = Field(gt=0, description="Most points that it gives.")
    levels: tuple[Level, ...] = Field(
        (),
        max_length=9,
        description="Levels to choose from, in the order of the keys 1 to 9; by default any "
        "number of points from 0.",
    )

    @model_validator(mode="after")
    def _within(self) -> ManualItem:
        for level in self.levels:
            if level.points > self.points:
                raise ValueError(
                    f"the level {level.title!r} gives {level.points:g} points, more than the item "
                    f"has ({self.points:g})"
                )
        return self


class Assignment(Model):
    """A lesson's assignment: `assignments/<id>/assignment.yaml`."""

    rosgrade: Literal[1] = Field(description="Version of this format.")
    id: Id = Field(description="Name of the assignment and of its folder.")
    title: str = Field(description="Title in one line.")
    variables: dict[Id, Variable] = Field(
        default_factory=dict,
        description="Names that students, groups or the roster choose: name -> its origin.",
    )
    contract: Contract | None = Field(
        None,
        description="What the ROS graph of a right submission looks like; the packages and the "
        "standard checks are made from it.",
    )
    packages: tuple[Package, ...] = Field(
        (),
        min_length=1,
        description="Packages that students hand in; they come from the contract. There need be "
        "none if all scenarios read a `bag`; nothing is built then.",
    )
    limits: LimitOptions = Field(
        default_factory=LimitOptions, description="Limits of the student's processes."
    )
    build_limits: BuildLimitOptions = Field(
        default_factory=BuildLimitOptions, description="Limits of the build of a submission."
    )
    libraries: tuple[LibraryName, ...] = Field(
        (),
        description="Python libraries that students may import in addition to the standard "
        "library, ROS and numpy, by their names for pip, such as `[scipy, pillow]`. They must be "
        "installed on the machine that grades. In a sandbox, students cannot import others. "
        "With a sourced ROS they can also import the system's; the report then names them.",
    )
    underlays: tuple[str, ...] = Field(
        (),
        description="What the assignment needs beyond rclpy and the common interfaces, such as "
        "`[tf2]`: a package of ROS 2 or a set of them (see `rosgrade underlay list`), a `.repos` "
        "file or a folder of packages, relative to assignment.yaml. All but a folder have to be "
        "built once on the machine that grades, by `rosgrade underlay add`. Packages in a folder "
        "`packages` beside assignment.yaml need no entry.",
    )
    scenarios: tuple[Scenario, ...] = Field((), description="The runs, or groups of them.")
    checks: tuple[CheckSpec, ...] = Field(
        min_length=1, description="What is judged, by single checks or groups of them."
    )
    manual: tuple[ManualItem, ...] = Field(
        (), description="What a person judges, in addition to the checks."
    )
    count_hints: bool = Field(
        False,
        description="Whether the page of `rosgrade watch` counts the further steps of hints that a "
        "student opens, and tells the student so. `hints_opened` in `result.json` has the counts.",
    )
    points: float | None = Field(
        None, ge=0, description="Sum of the points of all checks. If given, rosgrade verifies it."
    )
    withheld: Withheld = Field(
        NOTHING_WITHHELD,
        description="Hidden checks that are not in this file: `rosgrade export` writes it into "
        "the copy for students.",
    )

    @property
    def needs_build(self) -> bool:
        """Whether students hand in packages."""
        return bool(self.packages)

    def judged_by(self, spec: CheckSpec) -> tuple[Scenario, ...]:
        """The scenarios of a check of a run: those that it names, or all that run something.

        Where nothing is run, all bags.
        """
        if spec.scenarios:
            return tuple(one for one in self.scenarios if one.id in spec.scenarios)
        runs = tuple(scenario for scenario in self.scenarios if scenario.bag is None)
        return runs or self.scenarios
