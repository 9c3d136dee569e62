#include "red_rescue/medic.hpp"

#include <algorithm>
#include <chrono>

namespace {

constexpr double kSpeed = 0.25;
constexpr double kStepS = 0.1;

}  // namespace

Medic::Medic() : RobotNode("medic") {
  service_ = create_service<AssignVictim>(
    "/assign",
    [this](const AssignVictim::Request::SharedPtr request,
           AssignVictim::Response::SharedPtr response) { assign(*request, *response); });
  server_ = rclcpp_action::create_server<Rescue>(
    this, "/rescue",
    [this](const rclcpp_action::GoalUUID &, std::shared_ptr<const Rescue::Goal> goal) {
      return decide(*goal);
    },
    [](const std::shared_ptr<GoalHandle>) { return rclcpp_action::CancelResponse::ACCEPT; },
    [this](const std::shared_ptr<GoalHandle> handle) { start(handle); });
  timer_ = create_wall_timer(std::chrono::duration<double>(kStepS), [this] { step(); });
  timer_->cancel();
}

double Medic::speed() { return handle_ ? kSpeed : 0.0; }

void Medic::assign(const AssignVictim::Request & request, AssignVictim::Response & response) {
  response.accepted = request.severity >= 0.0 && request.severity <= 1.0;
  if (response.accepted) {
    assigned_.insert(request.victim);
  }
  response.waiting = static_cast<std::int32_t>(assigned_.size());
}

rclcpp_action::GoalResponse Medic::decide(const Rescue::Goal & goal) const {
  return assigned_.count(goal.victim) > 0 ? rclcpp_action::GoalResponse::ACCEPT_AND_EXECUTE
                                          : rclcpp_action::GoalResponse::REJECT;
}

void Medic::start(const std::shared_ptr<GoalHandle> & handle) {
  if (handle_) {
    handle_->abort(std::make_shared<Rescue::Result>());
  }
  handle_ = handle;
  driven_ = 0.0;
  timer_->reset();
}

void Medic::step() {
  const auto goal = handle_->get_goal();
  auto result = std::make_shared<Rescue::Result>();
  auto feedback = std::make_shared<Rescue::Feedback>();
  driven_ += kSpeed * kStepS;
  result->driven = driven_;
  feedback->remaining = std::max(0.0, goal->distance - driven_);
  handle_->publish_feedback(feedback);
  if (handle_->is_canceling()) {
    handle_->canceled(result);
  } else if (driven_ >= goal->distance) {
    assigned_.erase(goal->victim);
    handle_->succeed(result);
  } else {
    return;
  }
  handle_.reset();
  timer_->cancel();
}

int main(int argc, char ** argv) {
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<Medic>());
  rclcpp::shutdown();
  return 0;
}
