// THREADS is replaced by the way in which a program spins.
#include <chrono>

#include <rosidl_runtime_c/string_functions.h>
#include <std_msgs/msg/string.h>

#include "rcl_node.hpp"

class ExecutorDemo : public Node
{
public:
  ExecutorDemo(int argc, char ** argv)
  : Node(argc, argv, "executor_demo")
  {
    std_msgs__msg__String__init(&heard);
    const auto * type = ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, String);
    events = create_publisher(type, "/events", 10);
    create_wall_timer(1000, [this] {work("timer_1", 400);}, "ExecutorDemo::timer_1_callback()");
    create_wall_timer(1000, [this] {work("timer_2", 400);}, "ExecutorDemo::timer_2_callback()");
    create_subscription(
      type, "/chatter", &heard, [this] {work("chatter", 200);},
      "ExecutorDemo::chatter_callback()", 10);
  }

  ~ExecutorDemo() {std_msgs__msg__String__fini(&heard);}

private:
  void work(const std::string & callback, int milliseconds)
  {
    report(callback + " start");
    std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
    report(callback + " end");
  }

  void report(const std::string & text)
  {
    std_msgs__msg__String message;
    std_msgs__msg__String__init(&message);
    rosidl_runtime_c__String__assign(&message.data, text.c_str());
    check(rcl_publish(events, &message, nullptr));
    std_msgs__msg__String__fini(&message);
  }

  std_msgs__msg__String heard;
  rcl_publisher_t * events;
};

int main(int argc, char ** argv)
{
  ExecutorDemo node(argc, argv);
  node.THREADS();
}
