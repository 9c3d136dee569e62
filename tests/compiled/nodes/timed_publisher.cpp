#include <geometry_msgs/msg/twist.h>

#include "rcl_node.hpp"

class BotPublisher : public Node
{
public:
  BotPublisher(int argc, char ** argv)
  : Node(argc, argv, "bot_publisher")
  {
    publisher = create_publisher(
      ROSIDL_GET_MSG_TYPE_SUPPORT(geometry_msgs, msg, Twist), "/cmd_vel", 10);
    create_wall_timer(300, [this] {timer_callback();}, "BotPublisher::timer_callback()");
  }

private:
  void timer_callback()
  {
    geometry_msgs__msg__Twist message{};
    geometry_msgs__msg__Twist__init(&message);
    message.linear.x = 1.0;
    message.angular.z = 0.5;
    check(rcl_publish(publisher, &message, nullptr));
  }

  rcl_publisher_t * publisher;
};

int main(int argc, char ** argv)
{
  BotPublisher node(argc, argv);
  node.spin();
}
