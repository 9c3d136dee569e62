// A node on the C API of rcl: what rclcpp does for a student, in a few lines, for where only the
// wheels of ROS are. It emits the tracepoints of rclcpp, in its order.
#pragma once

#include <csignal>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <rcl/error_handling.h>
#include <rcl/rcl.h>
#include <rcl/logging.h>
#include <rcl_interfaces/srv/list_parameters.h>
#include <rcutils/logging_macros.h>
#include <tracetools/tracetools.h>

inline volatile std::sig_atomic_t interrupted = 0;

inline void ignore(rcl_ret_t) {}

inline void check(rcl_ret_t result)
{
  if (result != RCL_RET_OK) {
    throw std::runtime_error(rcl_get_error_string().str);
  }
}

class Node
{
public:
  using Callback = std::function<void()>;

  Node(int argc, char ** argv, const char * name)
  {
    std::signal(SIGINT, [](int) {interrupted = 1;});
    std::signal(SIGTERM, [](int) {interrupted = 1;});
    rcl_init_options_t options = rcl_get_zero_initialized_init_options();
    check(rcl_init_options_init(&options, allocator));
    check(rcl_init(argc, argv, &options, &context));
    check(rcl_init_options_fini(&options));
    check(rcl_logging_configure(&context.global_arguments, &allocator));
    check(rcl_steady_clock_init(&clock, &allocator));
    rcl_node_options_t node_options = rcl_node_get_default_options();
    check(rcl_node_init(&node, name, "", &context, &node_options));
    add_parameter_service();
  }

  ~Node()
  {
    for (auto & entity : entities) {
      entity->destroy();
    }
    for (auto & publisher : publishers) {
      ignore(rcl_publisher_fini(publisher.get(), &node));
    }
    ignore(rcl_node_fini(&node));
    ignore(rcl_steady_clock_fini(&clock));
    ignore(rcl_logging_fini());
    ignore(rcl_shutdown(&context));
    ignore(rcl_context_fini(&context));
  }

  rcl_publisher_t * create_publisher(
    const rosidl_message_type_support_t * type, const char * topic, size_t depth = 10)
  {
    publishers.push_back(std::make_unique<rcl_publisher_t>(rcl_get_zero_initialized_publisher()));
    rcl_publisher_options_t options = rcl_publisher_get_default_options();
    options.qos.depth = depth;
    check(rcl_publisher_init(publishers.back().get(), &node, type, topic, &options));
    return publishers.back().get();
  }

  void create_subscription(
    const rosidl_message_type_support_t * type, const char * topic, void * message,
    Callback callback, const char * symbol, size_t depth = 10)
  {
    Entity * entity = add(std::move(callback), symbol);
    rcl_subscription_options_t options = rcl_subscription_get_default_options();
    options.qos.depth = depth;
    entity->subscription = std::make_unique<rcl_subscription_t>(
      rcl_get_zero_initialized_subscription());
    rcl_subscription_t * handle = entity->subscription.get();
    check(rcl_subscription_init(handle, &node, type, topic, &options));
    entity->take = [handle, message] {
        rmw_message_info_t info = rmw_get_zero_initialized_message_info();
        return rcl_take(handle, message, &info, nullptr) == RCL_RET_OK;
      };
    entity->destroy = [this, handle] {ignore(rcl_subscription_fini(handle, &node));};
    TRACETOOLS_TRACEPOINT(rclcpp_subscription_init, handle, entity);
    TRACETOOLS_TRACEPOINT(rclcpp_subscription_callback_added, entity, &entity->callback);
  }

  rcl_timer_t * create_wall_timer(int64_t period_ms, Callback callback, const char * symbol)
  {
    Entity * entity = add(std::move(callback), symbol);
    entity->timer = std::make_unique<rcl_timer_t>(rcl_get_zero_initialized_timer());
    rcl_timer_t * handle = entity->timer.get();
    check(
      rcl_timer_init2(
        handle, &clock, &context, RCL_MS_TO_NS(period_ms), nullptr, allocator, true));
    entity->take = [handle] {return rcl_timer_call(handle) == RCL_RET_OK;};
    entity->destroy = [handle] {ignore(rcl_timer_fini(handle));};
    TRACETOOLS_TRACEPOINT(rclcpp_timer_callback_added, handle, &entity->callback);
    TRACETOOLS_TRACEPOINT(rclcpp_timer_link_node, handle, &node);
    return handle;
  }

  // Call callbacks one after the other, until Ctrl-C.
  void spin()
  {
    std::vector<Entity *> all;
    for (auto & entity : entities) {
      all.push_back(entity.get());
    }
    spin(all);
  }

  // Call the callbacks of each timer, subscription and service in a thread of its own.
  void spin_in_threads()
  {
    std::vector<std::thread> threads;
    for (auto & entity : entities) {
      threads.emplace_back([this, &entity] {spin({entity.get()});});
    }
    for (auto & thread : threads) {
      thread.join();
    }
  }

  rcl_context_t context = rcl_get_zero_initialized_context();
  rcl_node_t node = rcl_get_zero_initialized_node();

private:
  struct Entity
  {
    Callback callback;
    std::function<bool()> take;
    std::function<void()> destroy;
    std::unique_ptr<rcl_subscription_t> subscription;
    std::unique_ptr<rcl_timer_t> timer;
    std::unique_ptr<rcl_service_t> service;
  };

  Entity * add(Callback callback, const char * symbol)
  {
    entities.push_back(std::make_unique<Entity>());
    Entity * entity = entities.back().get();
    entity->callback = std::move(callback);
    TRACETOOLS_TRACEPOINT(rclcpp_callback_register, &entity->callback, symbol);
    return entity;
  }

  // The service by which rosgrade asks whether the node spins.
  void add_parameter_service()
  {
    Entity * entity = add([] {}, "rclcpp::ParameterService");
    entity->service = std::make_unique<rcl_service_t>(rcl_get_zero_initialized_service());
    rcl_service_t * handle = entity->service.get();
    rcl_service_options_t options = rcl_service_get_default_options();
    const auto * type = ROSIDL_GET_SRV_TYPE_SUPPORT(rcl_interfaces, srv, ListParameters);
    check(rcl_service_init(handle, &node, type, "~/list_parameters", &options));
    entity->take = [handle] {
        rmw_request_id_t id;
        rcl_interfaces__srv__ListParameters_Request request;
        rcl_interfaces__srv__ListParameters_Response response;
        rcl_interfaces__srv__ListParameters_Request__init(&request);
        rcl_interfaces__srv__ListParameters_Response__init(&response);
        const bool taken = rcl_take_request(handle, &id, &request) == RCL_RET_OK &&
          rcl_send_response(handle, &id, &response) == RCL_RET_OK;
        rcl_interfaces__srv__ListParameters_Request__fini(&request);
        rcl_interfaces__srv__ListParameters_Response__fini(&response);
        return taken;
      };
    entity->destroy = [this, handle] {ignore(rcl_service_fini(handle, &node));};
    TRACETOOLS_TRACEPOINT(rclcpp_service_callback_added, handle, &entity->callback);
  }

  void spin(const std::vector<Entity *> & own)
  {
    size_t subscriptions = 0, timers = 0, services = 0;
    for (Entity * entity : own) {
      subscriptions += !!entity->subscription;
      timers += !!entity->timer;
      services += !!entity->service;
    }
    rcl_wait_set_t set = rcl_get_zero_initialized_wait_set();
    check(
      rcl_wait_set_init(&set, subscriptions, 0, timers, 0, services, 0, &context, allocator));
    while (!interrupted) {
      wait_once(set, own);
    }
    ignore(rcl_wait_set_fini(&set));
  }

  void wait_once(rcl_wait_set_t & set, const std::vector<Entity *> & own)
  {
    check(rcl_wait_set_clear(&set));
    std::vector<size_t> places;
    for (Entity * entity : own) {
      places.emplace_back();
      if (entity->subscription) {
        check(rcl_wait_set_add_subscription(&set, entity->subscription.get(), &places.back()));
      } else if (entity->timer) {
        check(rcl_wait_set_add_timer(&set, entity->timer.get(), &places.back()));
      } else {
        check(rcl_wait_set_add_service(&set, entity->service.get(), &places.back()));
      }
    }
    const rcl_ret_t result = rcl_wait(&set, RCL_MS_TO_NS(100));
    if (result == RCL_RET_TIMEOUT) {
      return;
    }
    check(result);
    for (size_t i = 0; i < own.size() && !interrupted; ++i) {
      Entity * entity = own[i];
      const void * ready = entity->subscription ?
        static_cast<const void *>(set.subscriptions[places[i]]) : entity->timer ?
        static_cast<const void *>(set.timers[places[i]]) :
        static_cast<const void *>(set.services[places[i]]);
      if (ready && entity->take()) {
        TRACETOOLS_TRACEPOINT(callback_start, &entity->callback, false);
        entity->callback();
        TRACETOOLS_TRACEPOINT(callback_end, &entity->callback);
      }
    }
  }

  rcl_allocator_t allocator = rcl_get_default_allocator();
  rcl_clock_t clock;
  std::vector<std::unique_ptr<rcl_publisher_t>> publishers;
  std::vector<std::unique_ptr<Entity>> entities;
};
