#include "robot_classes/drone.hpp"

Drone::Drone() : RobotNode("drone") {}

double Drone::move() { return 0.25; }
