// Ends in the way that its argument names.

#include <cassert>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

struct Bot : std::enable_shared_from_this<Bot>
{
  Bot() {shared_from_this();}
};

struct Base
{
  Base() {call();}
  virtual ~Base() = default;
  void call() {work();}
  virtual void work() = 0;
};

struct Derived : Base
{
  void work() override {}
};

int main(int, char ** argv)
{
  const std::string way = argv[1];
  std::vector<double> ranges;
  std::function<void()> callback;
  double * nothing = nullptr;
  if (way == "throws") {throw std::runtime_error("no scan yet");}
  if (way == "throws again") {
    try {
      throw std::runtime_error("inner");
    } catch (...) {
      std::throw_with_nested(std::runtime_error("outer"));
    }
  }
  if (way == "throws a number") {throw 3;}
  if (way == "leaves a thread") {std::thread thread([] {while (true) {}});}
  if (way == "asks for all memory") {ranges.reserve(1ul << 59);}
  if (way == "calls nothing") {callback();}
  if (way == "shares itself") {Bot bot;}
  if (way == "reads beyond") {ranges.at(3);}
  if (way == "reads no file") {std::filesystem::directory_iterator("/nowhere");}
  if (way == "asserts") {assert(ranges.size() == 1);}
  if (way == "frees twice") {
    nothing = new double;
    delete nothing;
    delete nothing;
  }
  if (way == "calls a pure function") {Derived derived;}
  if (way == "aborts") {std::abort();}
  if (way == "writes to null") {*nothing = 1.0;}
}
