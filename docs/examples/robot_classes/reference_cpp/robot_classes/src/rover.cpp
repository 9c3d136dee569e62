#include "robot_classes/rover.hpp"

Rover::Rover() : RobotNode("rover") {}

double Rover::move() { return 0.1; }
