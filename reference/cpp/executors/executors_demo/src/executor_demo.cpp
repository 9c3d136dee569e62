#include "executors_demo/executor_demo.hpp"

#include <functional>
#include <thread>

using namespace std::chrono_literals;

ExecutorDemo::ExecutorDemo(rclcpp::CallbackGroupType timer_group_type)
: Node("executor_demo")
{
  timer_group_ = this->create_callback_group(timer_group_type);
  chatter_group_ = this->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive);

  events_ = this->create_publisher<std_msgs::msg::String>("/events", 10);
  timer_1_ = this->create_wall_timer(
    1s, std::bind(&ExecutorDemo::timer_1_callback, this), timer_group_);
  timer_2_ = this->create_wall_timer(
    1s, std::bind(&ExecutorDemo::timer_2_callback, this), timer_group_);

  rclcpp::SubscriptionOptions options;
  options.callback_group = chatter_group_;
  subscription_ = this->create_subscription<std_msgs::msg::String>(
    "/chatter", 10,
    std::bind(&ExecutorDemo::chatter_callback, this, std::placeholders::_1), options);
}

void ExecutorDemo::timer_1_callback()
{
  work("timer_1", 400ms);
}

void ExecutorDemo::timer_2_callback()
{
  work("timer_2", 400ms);
}

void ExecutorDemo::chatter_callback(const std_msgs::msg::String &)
{
  work("chatter", 200ms);
}

void ExecutorDemo::work(const std::string & callback, std::chrono::milliseconds duration)
{
  std_msgs::msg::String event;
  event.data = callback + " start";
  events_->publish(event);
  std::this_thread::sleep_for(duration);
  event.data = callback + " end";
  events_->publish(event);
}
