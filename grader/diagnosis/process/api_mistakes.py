"""Slips with rclpy that raise an exception whose own words do not say to a beginner what to do."""

from __future__ import annotations

import re

from grader.checks.wording import code, codes
from grader.diagnosis.process.raised import Failure

# What rclpy's Node has as a property without a setter.
_NODE_PROPERTIES = (
    *("publishers", "subscriptions", "clients", "services", "timers", "guards", "waitables"),
    *("context", "default_callback_group", "handle"),
)
# Python 3.11 and later, Python 3.10.
_NO_SETTER = re.compile(
    r"property '(\w+)' of '\w+' object has no setter|can't set attribute '(\w+)'"
)
_CALLED = re.compile(r"(\w+)\(\) missing \d+ required positional arguments?:")
_BY_PLACE = re.compile(r"(\w+)\.__init__\(\) takes 1 positional argument but \d+")

_LOGGER_HINT = (
    "A logger takes one text: self.get_logger().info(f'x = {x}'), or info(str(x)) for a value "
    "alone."
)
_TOO_MANY_BY_PLACE = re.compile(r"Node\.create_\w+\(\) takes .*positional arguments? but")
_NOT_A_MESSAGE = re.compile(r"Expected <class '[\w.]+\.(\w+)'>, got <class '([\w.]+)'>")
_NO_POLICY = re.compile(r"Invalid arguments passed to constructor: dict_keys\((.*)\)")
_POLICIES = (
    *("history", "depth", "reliability", "durability", "lifespan", "deadline", "liveliness"),
    *("liveliness_lease_duration", "avoid_ros_namespace_conventions"),
)
_NOT_A_PERIOD = re.compile(r"float\(\) argument must be a .*number, not '(\w+)'")
_PLAIN = re.compile(r"'(?:float|int|str|bool|list|tuple|dict)' object has no attribute '(\w+)'")
_TIMER_HINT = (
    "create_timer takes the period first, a number of seconds, then the function: "
    "self.create_timer(0.5, self.timer_callback)."
)
_NO_INTEGER = re.compile(r"'(\w+)' object cannot be interpreted as an integer")
# Parts of a message -> what to try. The names in them are rclpy's own, or those of Python.
_HINTS = {
    "no running event loop": "rclpy runs coroutines itself, without asyncio, so that "
    "asyncio.sleep() and the like do not work in a callback. For a pause create a timer.",
    "returned a result with an exception set": "A field of the message holds what does not belong "
    "there, such as a float or a text in a field of integers: write int(value).",
    "RcutilsLogger.": _LOGGER_HINT,
    "rclpy_logging_rcutils_log(): incompatible": _LOGGER_HINT,
    "Context.init() must only be called once": "rclpy.init() is called once in a program, at the "
    "beginning of main(): remove the second call.",
    "'numpy.ndarray' object has no attribute 'append'": "An array of fixed length has all its "
    "values from the start, so that nothing can be appended: assign the whole list, "
    "msg.values = [a, b].",
    "without a depth setting": "Say how many messages are kept: QoSProfile(..., depth=10).",
    "unexpected keyword argument 'qos'": "The argument is called qos_profile; without a name it "
    "is the last one.",
    "rclpy_resolve_name(): incompatible": "First the class of the messages, then the name of the "
    "topic as a text: create_publisher(String, 'chatter', 10), and the same way in "
    "create_subscription.",
    "'PoseWithCovariance' object has no": "An Odometry holds the pose two levels deep: msg.pose "
    "has a covariance too, and msg.pose.pose is the pose.",
    "'TwistWithCovariance' object has no": "An Odometry holds the twist two levels deep: "
    "msg.twist has a covariance too, and msg.twist.twist is the twist.",
    "Expected QoSProfile or int": "The queue size comes last: create_publisher(String, 'chatter', "
    "10), create_subscription(String, 'chatter', self.callback, 10).",
    "generator already executing": "Do not spin in a callback: the executor that called it spins "
    "already, and calls the next one when this one returns.",
    "Node.create_timer() got an unexpected keyword": _TIMER_HINT,
    "Node.create_timer() missing": _TIMER_HINT,
    "can only concatenate str": "Write an f-string in place of +: f'x = {x:.2f}'.",
    "'Parameter' and": "get_parameter() gives a Parameter; what it holds is "
    "self.get_parameter('name').value.",
    "and 'Parameter'": "get_parameter() gives a Parameter; what it holds is "
    "self.get_parameter('name').value.",
}


def mistake_hint(failure: Failure) -> str | None:
    """What to try after such an exception; None if it is no known one."""
    taken = _NO_SETTER.match(failure.message)
    if taken and (name := taken[1] or taken[2]) in _NODE_PROPERTIES:
        return (
            f"rclpy's Node has {code(name)} itself: give your attribute another name, such as "
            f"self.my_{name}."
        )
    called = _CALLED.search(failure.message)
    source = failure.frames[-1].source if failure.frames else ""
    if called and "load_entry_point(" in source:
        return (
            f"`ros2 run` calls {code(f'{called[1]}()')} without arguments: write "
            f"{code(f'def {called[1]}(args=None):')}."
        )
    if called and re.search(rf"\b{called[1]}\(\)\s*[,)]", source):
        return (
            f"Hand over a callback without brackets, {code(f'self.{called[1]}')}: with them you "
            "call it yourself, at once and without a message."
        )
    by_place = _BY_PLACE.match(failure.message)
    if by_place and by_place[1] == "QoSProfile":
        return "QoSProfile takes its policies by name: QoSProfile(depth=10, reliability=...)."
    if by_place:
        return (
            f"If {code(by_place[1])} is a message: name its fields, such as "
            "Vector3(x=1.0, y=2.0, z=0.0). If it is a class of your own: its __init__ takes "
            "nothing but self."
        )
    published = _NOT_A_MESSAGE.match(failure.message)
    if published and published[2].endswith(f".Metaclass_{published[1]}"):
        return (
            f"That is the class {code(published[1])} itself: make a message of it with brackets, "
            f"msg = {published[1]}(), fill it in and publish that."
        )
    if published:
        return (
            "publish() takes a message of the publisher's class: make one, "
            f"msg = {published[1]}(), fill it in and publish that."
        )
    if _TOO_MANY_BY_PLACE.match(failure.message):
        return (
            "After the queue size, or after the callback of a timer or a service, arguments are "
            "given by name: callback_group=group."
        )
    raised_in = failure.frames[-1].file if failure.frames else ""
    plain = _PLAIN.match(failure.message)
    if plain and raised_in.endswith("rclpy/publisher.py"):
        return (
            "The line that publishes is right, but a field that is itself a message was given a "
            f"plain value before: set what is in it, msg.field.{plain[1]} = 1.0 instead of "
            "msg.field = 1.0."
        )
    number = _NO_INTEGER.match(failure.message)
    if number and raised_in.endswith("rclpy/publisher.py"):
        return (
            f"The line that publishes is right, but a field of integers was given a {number[1]} "
            "before: write int(value)."
        )
    if "'property' object" in failure.message and raised_in.endswith("rclpy/executors.py"):
        return (
            "An executor runs nodes, not their classes: create one with brackets, node = MyNode(), "
            "and call rclpy.spin(node)."
        )
    if raised_in.endswith("rclpy/guard_condition.py"):
        return (
            "There is no context at this point: call rclpy.init() first, and rclpy.shutdown() only "
            "after rclpy.spin() has returned."
        )
    if _NOT_A_PERIOD.match(failure.message) and raised_in.endswith("rclpy/node.py"):
        return _TIMER_HINT
    if failure.message.endswith("is not callable") and raised_in.endswith("rclpy/executors.py"):
        return (
            "rclpy was given something else than a function to call, perhaps the result of one: "
            "hand over a callback without brackets, self.create_timer(0.5, self.timer_callback). "
            "With them you call it yourself, once and at once."
        )
    unknown = _NO_POLICY.match(failure.message)
    if unknown:
        given = [name for name in re.findall(r"'(\w+)'", unknown[1]) if name not in _POLICIES]
        return (
            f"QoSProfile has no {codes(given, 'or')}: it takes history, depth, reliability, "
            "durability, lifespan, deadline and liveliness, and depth is the queue size."
        )
    if failure.type == "AssertionError" and raised_in.endswith("rclpy/qos.py"):
        return (
            "A policy is a member of its enum, such as DurabilityPolicy.TRANSIENT_LOCAL, and not "
            "its name as a text."
        )
    return next((hint for part, hint in _HINTS.items() if part in failure.message), None)
