// An action server that computes Fibonacci numbers, slowly.

#include <chrono>
#include <memory>

#include "example_interfaces/action/fibonacci.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_action/rclcpp_action.hpp"

using namespace std::chrono_literals;
using Fibonacci = example_interfaces::action::Fibonacci;
using GoalHandle = rclcpp_action::ServerGoalHandle<Fibonacci>;

/// Offers the action /fibonacci; a new goal ends the one before it.
class FibonacciServer : public rclcpp::Node
{
public:
  FibonacciServer()
  : Node("fibonacci_server")
  {
    server_ = rclcpp_action::create_server<Fibonacci>(
      this, "fibonacci",
      [](const rclcpp_action::GoalUUID &, std::shared_ptr<const Fibonacci::Goal> goal) {
        const bool right = goal->order >= 1 && goal->order <= kLargestOrder;
        return right ? rclcpp_action::GoalResponse::ACCEPT_AND_EXECUTE :
               rclcpp_action::GoalResponse::REJECT;
      },
      [](const std::shared_ptr<GoalHandle>) {return rclcpp_action::CancelResponse::ACCEPT;},
      [this](const std::shared_ptr<GoalHandle> handle) {start(handle);});
    timer_ = create_wall_timer(100ms, [this] {step();});
    timer_->cancel();
  }

private:
  /// Ends the goal before this one, then begins.
  void start(const std::shared_ptr<GoalHandle> & handle)
  {
    if (handle_ && handle_->is_active()) {
      handle_->abort(std::make_shared<Fibonacci::Result>());
    }
    handle_ = handle;
    feedback_ = std::make_shared<Fibonacci::Feedback>();
    feedback_->sequence = {0, 1};
    timer_->reset();
    finish_if_done();
  }

  /// Computes one number and tells it.
  void step()
  {
    if (handle_->is_canceling()) {
      timer_->cancel();
      handle_->canceled(std::make_shared<Fibonacci::Result>());
      return;
    }
    auto & sequence = feedback_->sequence;
    sequence.push_back(sequence[sequence.size() - 1] + sequence[sequence.size() - 2]);
    handle_->publish_feedback(feedback_);
    finish_if_done();
  }

  void finish_if_done()
  {
    const auto numbers = static_cast<std::size_t>(handle_->get_goal()->order) + 1;
    if (feedback_->sequence.size() < numbers) {
      return;
    }
    timer_->cancel();
    auto result = std::make_shared<Fibonacci::Result>();
    result->sequence = feedback_->sequence;
    handle_->succeed(result);
  }

  static constexpr int kLargestOrder = 30;
  rclcpp_action::Server<Fibonacci>::SharedPtr server_;
  rclcpp::TimerBase::SharedPtr timer_;
  std::shared_ptr<GoalHandle> handle_;
  std::shared_ptr<Fibonacci::Feedback> feedback_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<FibonacciServer>());
  rclcpp::shutdown();
  return 0;
}
