/* The tracer of compiled programs: tells the cell what DDS does not carry.
 *
 * It is preloaded, so the functions of rcl's C API that are defined here are called before those of
 * librcl, and call them. Each use is reported as one JSON line on a pipe of the cell, in the words
 * of the tracer in Python (sitecustomize.py), which speaks for processes of Python. Callbacks are
 * seen at the tracepoints that every client library calls around them (package tracetools), the
 * executor and the callback groups at functions of librclcpp. It changes nothing else, but for
 * what the tracer in Python does as well: a publisher on a topic that the probe listens to is held
 * until it is matched, and the machine has four CPUs at least for a MultiThreadedExecutor.
 *
 * Where a program crashes, the student's functions that were being called are written to stderr.
 */

#define _GNU_SOURCE

#include <dlfcn.h>
#include <execinfo.h>
#include <fcntl.h>
#include <link.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <rcl/context.h>
#include <rcl/node.h>
#include <rcl/publisher.h>
#include <rcl/service.h>
#include <rcl/subscription.h>
#include <rcl/timer.h>
#include <rcl/wait.h>
#include <rosidl_runtime_c/message_type_support_struct.h>
#include <rosidl_runtime_c/type_description/type_description__struct.h>

#define PUBLIC __attribute__((visibility("default")))

enum {
  LONGEST_LINE = 4000, /* Writes up to PIPE_BUF bytes are atomic. */
  MOST_ENTITIES = 1024,
  MOST_RUNS = 1000,
  MOST_FRAMES = 64,
  MOST_SHOWN = 8,
  DEEPEST = 16,
  LEAST_THREADS = 4
};
static const int64_t MS = 1000000;
static const int64_t HOLD_LIMIT_MS = 2000, HOLD_POLL_MS = 2, PAUSE_POLL_MS = 5, FLUSH_LIMIT_MS = 500;
static const int64_t SEEN_LIMIT_MS = 2000, SYMBOLS_LIMIT_MS = 3000;
/* Of shorter runs, those that overlap none and those that do: the 1st, 2nd, 4th, 8th, ... */
static const int64_t SHORT_NS = 1000000;
/* And the first of those that overlap another. */
static const unsigned long FIRST_SHORT = 20;

extern char ** environ;

/* Reports */

static int tracer_fd = -1, seen_fd = -1, pause_fd = -1;
static struct stat tracer_pipe, pause_pipe;
static bool active;
static const char * held_topics = "";
static char program[4096];

typedef struct
{
  char text[LONGEST_LINE];
  size_t length;
} line_t;

static void add(line_t * line, const char * format, ...)
{
  va_list arguments;
  va_start(arguments, format);
  int length = vsnprintf(
    line->text + line->length, sizeof(line->text) - line->length, format, arguments);
  va_end(arguments);
  line->length += length < 0 ? sizeof(line->text) : (size_t)length;
  if (line->length >= sizeof(line->text)) {
    line->length = sizeof(line->text); /* Too long: it is not sent. */
  }
}

static void add_text(line_t * line, const char * key, const char * text)
{
  add(line, ", \"%s\": \"", key);
  for (const unsigned char * byte = (const unsigned char *)(text ? text : ""); *byte; ++byte) {
    add(line, *byte == '"' || *byte == '\\' ? "\\%c" : *byte < 32 ? "\\u%04x" : "%c", *byte);
  }
  add(line, "\"");
}

static line_t begin(const char * kind)
{
  line_t line;
  line.length = 0;
  add(&line, "{\"kind\": \"%s\", \"pid\": %d", kind, (int)getpid());
  return line;
}

static bool is_pipe(int fd, struct stat * status)
{
  return fstat(fd, status) == 0 && S_ISFIFO(status->st_mode);
}

static void send_line(line_t * line)
{
  add(line, "}\n");
  /* The program may have closed the pipe, and something else may have its number now. */
  struct stat now;
  if (active && line->length < sizeof(line->text) && is_pipe(tracer_fd, &now) &&
    now.st_ino == tracer_pipe.st_ino && now.st_dev == tracer_pipe.st_dev)
  {
    ssize_t written = write(tracer_fd, line->text, line->length);
    (void)written;
  }
}

static int64_t now_ns(clockid_t clock)
{
  struct timespec time;
  clock_gettime(clock, &time);
  return (int64_t)time.tv_sec * 1000 * MS + time.tv_nsec;
}

/* After the observation executors find nothing ready: what is published then, they did not call. */

/* The cell asks for it by writing, until it closes its end. */
static bool is_paused(void)
{
  struct pollfd asked = {.fd = active ? pause_fd : -1, .events = POLLIN};
  struct stat now;
  return poll(&asked, 1, 0) > 0 && asked.revents == POLLIN && is_pipe(pause_fd, &now) &&
         now.st_ino == pause_pipe.st_ino && now.st_dev == pause_pipe.st_dev;
}

/* Wait as an executor to which nothing happens; whether its timeout is over first. */
static bool pause_executor(int64_t timeout)
{
  static atomic_bool is_told;
  if (!atomic_exchange(&is_told, true)) {
    line_t line = begin("paused");
    send_line(&line);
  }
  int64_t began = now_ns(CLOCK_MONOTONIC);
  while (is_paused()) {
    if (timeout >= 0 && now_ns(CLOCK_MONOTONIC) - began >= timeout) {
      return true;
    }
    nanosleep(&(struct timespec){.tv_nsec = PAUSE_POLL_MS * MS}, NULL);
  }
  return false;
}

/* The functions that are called in the end */

static void * real(const char * name, const char * library)
{
  void * found = dlsym(RTLD_NEXT, name);
  if (found == NULL) {
    /* Python loads its libraries with local scope. */
    void * handle = dlopen(library, RTLD_LAZY | RTLD_NOLOAD);
    found = handle ? dlsym(handle, name) : NULL;
  }
  return found;
}

#define REAL(name, library) \
  static __typeof__(&name) next; \
  if (next == NULL) {next = (__typeof__(&name))real(#name, library);}

#define CALL(name) ((__typeof__(&name))real(#name, "librcl.so"))

/* What the process has made: publishers, subscriptions, timers and services */

typedef struct
{
  const void * handle; /* NULL: free. */
  const char * kind;
  char serves[256]; /* Topic or service; of a timer its period. */
  int number;
  bool is_held;
  bool is_taken_from;
  const void * owner; /* rclcpp's object around the handle. */
  const void * callback;
  char symbol[512];
  const void * group;
  unsigned long calls[2]; /* Those that overlapped none, and those that did. */
} entity_t;

static entity_t entities[MOST_ENTITIES];
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static int count;
static atomic_int nodes;
static atomic_int spinning, reported_runs;
static _Thread_local entity_t * newest;

/* Call with the lock. */
static entity_t * find(const void * handle)
{
  for (entity_t * one = entities; handle && one < entities + MOST_ENTITIES; ++one) {
    if (one->handle == handle) {
      return one;
    }
  }
  return NULL;
}

static entity_t * keep(const void * handle, const char * kind, const char * serves)
{
  entity_t * one = find(handle);
  for (entity_t * free = entities; !one && free < entities + MOST_ENTITIES; ++free) {
    one = free->handle ? NULL : free;
  }
  if (one) {
    *one = (entity_t){.handle = handle, .kind = kind, .number = count++};
    snprintf(one->serves, sizeof(one->serves), "%s", serves ? serves : "");
  }
  newest = one;
  return one;
}

static entity_t * of_owner(const void * owner)
{
  for (entity_t * one = entities; one < entities + MOST_ENTITIES; ++one) {
    if (one->handle && one->owner == owner) {
      return one;
    }
  }
  return NULL;
}

static entity_t * of_callback(const void * callback)
{
  for (entity_t * one = entities; one < entities + MOST_ENTITIES; ++one) {
    if (one->handle && one->callback == callback) {
      return one;
    }
  }
  return NULL;
}

static bool ends_with(const char * text, const char * end)
{
  size_t length = strlen(text), most = strlen(end);
  return length >= most && strcmp(text + length - most, end) == 0;
}

/* Whether a client library makes it by itself; the tracer in Python does not see these. */
static bool is_own(const char * topic)
{
  return strcmp(topic, "/parameter_events") == 0 || strcmp(topic, "/rosout") == 0 ||
         strstr(topic, "/_action/") != NULL || ends_with(topic, "/transition_event");
}

static bool is_listened_to(const char * topic)
{
  size_t length = strlen(topic);
  for (const char * found = held_topics; (found = strstr(found, topic)); found += length) {
    bool begins = found == held_topics || found[-1] == ':';
    if (begins && (found[length] == ':' || found[length] == '\0')) {
      return true;
    }
  }
  return false;
}

/* Environment variables that decide which nodes discover each other */

static char * at_start[256];

static bool is_of_middleware(const char * variable)
{
  static const char * const prefixes[] = {"ROS_", "RMW_", "FASTDDS_", "FASTRTPS_", "CYCLONEDDS_"};
  static const char * const harmless[] = {
    "ROS_LOG_DIR=", "ROS_HOME=", "ROS_DISTRO=", "ROS_VERSION=", "ROS_PYTHON_VERSION="};
  bool found = false;
  for (size_t i = 0; i < sizeof(prefixes) / sizeof(*prefixes); ++i) {
    found = found || strncmp(variable, prefixes[i], strlen(prefixes[i])) == 0;
  }
  for (size_t i = 0; i < sizeof(harmless) / sizeof(*harmless); ++i) {
    found = found && strncmp(variable, harmless[i], strlen(harmless[i])) != 0;
  }
  return found;
}

static void keep_environment(void)
{
  size_t kept = 0;
  for (char ** one = environ; *one && kept < sizeof(at_start) / sizeof(*at_start) - 1; ++one) {
    if (is_of_middleware(*one)) {
      at_start[kept++] = strdup(*one);
    }
  }
}

static bool is_among(char * const * all, const char * variable, size_t length)
{
  for (; *all; ++all) {
    if (strncmp(*all, variable, length) == 0) {
      return true;
    }
  }
  return false;
}

static void add_changed(line_t * line, char * const * of, char * const * other)
{
  for (; *of; ++of) {
    const char * end = strchr(*of, '=');
    if (end && is_of_middleware(*of) && !is_among(other, *of, strlen(*of) + 1)) {
      add(line, "%.*s ", (int)(end - *of), *of);
    }
  }
}

/* rcl: context, nodes, endpoints, timers */

/* Wait until the cell has seen what was created. */
static void await_seen(void)
{
  struct stat unused;
  if (nodes > 0 && is_pipe(seen_fd, &unused)) {
    nodes = 0;
    line_t line = begin("leaving");
    send_line(&line);
    /* The cell closes its end. */
    poll(&(struct pollfd){.fd = seen_fd, .events = POLLIN}, 1, SEEN_LIMIT_MS);
  }
}

/* Let what was published arrive, and what was created be seen, before it goes away. */
static void flush(void)
{
  if (!active) {
    return;
  }
  pthread_mutex_lock(&lock);
  for (entity_t * one = entities; one < entities + MOST_ENTITIES; ++one) {
    if (one->handle && one->is_held) {
      one->is_held = false;
      rcl_ret_t ret = CALL(rcl_publisher_wait_for_all_acked)(one->handle, FLUSH_LIMIT_MS * MS);
      (void)ret;
    }
  }
  pthread_mutex_unlock(&lock);
  await_seen();
}

PUBLIC rcl_ret_t rcl_init(
  int argc, char const * const * argv, const rcl_init_options_t * options, rcl_context_t * context)
{
  REAL(rcl_init, "librcl.so");
  rcl_ret_t result = next(argc, argv, options, context);
  if (result == RCL_RET_OK && active) {
    line_t line = begin("init");
    add(&line, ", \"changed\": \"");
    add_changed(&line, environ, at_start);
    add_changed(&line, at_start, environ);
    size_t domain_id = 0;
    const char * given = getenv("ROS_DOMAIN_ID");
    if (CALL(rcl_context_get_domain_id)(context, &domain_id) == RCL_RET_OK &&
      domain_id != strtoul(given ? given : "0", NULL, 10))
    {
      add(&line, "ROS_DOMAIN_ID");
    }
    add(&line, "\"");
    send_line(&line);
  }
  return result;
}

PUBLIC rcl_ret_t rcl_shutdown(rcl_context_t * context)
{
  REAL(rcl_shutdown, "librcl.so");
  flush();
  return next(context);
}

PUBLIC rcl_ret_t rcl_node_init(
  rcl_node_t * node, const char * name, const char * namespace_, rcl_context_t * context,
  const rcl_node_options_t * options)
{
  REAL(rcl_node_init, "librcl.so");
  rcl_ret_t result = next(node, name, namespace_, context, options);
  if (result == RCL_RET_OK && active) {
    ++nodes;
    line_t line = begin("node");
    add_text(&line, "node", CALL(rcl_node_get_fully_qualified_name)(node));
    send_line(&line);
  }
  return result;
}

PUBLIC rcl_ret_t rcl_node_fini(rcl_node_t * node)
{
  REAL(rcl_node_fini, "librcl.so");
  flush();
  return next(node);
}

static void report_endpoint(
  const void * handle, const char * kind, const rcl_node_t * node, const char * topic,
  const rosidl_message_type_support_t * type, const rmw_qos_profile_t * qos)
{
  static const char * const reliability[] = {
    "system_default", "reliable", "best_effort", "unknown", "best_available"};
  static const char * const durability[] = {
    "system_default", "transient_local", "volatile", "unknown", "best_available"};
  static const char * const history[] = {"system_default", "keep_last", "keep_all", "unknown"};
  if (!active || !topic || is_own(topic)) {
    return;
  }
  pthread_mutex_lock(&lock);
  entity_t * one = keep(handle, kind, topic);
  int number = one ? one->number : -1;
  pthread_mutex_unlock(&lock);
  line_t line = begin(kind);
  add(&line, ", \"number\": %d", number);
  add_text(&line, "node", CALL(rcl_node_get_fully_qualified_name)(node));
  add_text(&line, "topic", topic);
  if (type && type->get_type_description_func) {
    const rosidl_runtime_c__String * name =
      &type->get_type_description_func(type)->type_description.type_name;
    add_text(&line, "type", name->data);
  }
  add_text(&line, "reliability", reliability[qos->reliability > 4 ? 3 : qos->reliability]);
  add_text(&line, "durability", durability[qos->durability > 4 ? 3 : qos->durability]);
  add_text(&line, "history", history[qos->history > 3 ? 3 : qos->history]);
  add(&line, ", \"depth\": %zu", qos->depth);
  send_line(&line);
}

static void forget(const void * handle)
{
  int number = -1;
  bool is_brief = false;
  pthread_mutex_lock(&lock);
  entity_t * one = find(handle);
  if (one) {
    /* One that rclcpp::wait_for_message() made. */
    is_brief = one->is_taken_from && !spinning;
    /* Services are not declared. */
    number = strcmp(one->kind, "service") != 0 ? one->number : -1;
    one->handle = NULL;
  }
  pthread_mutex_unlock(&lock);
  if (number >= 0) {
    line_t line = begin("destroyed");
    add(&line, ", \"number\": %d, \"brief\": %s", number, is_brief ? "true" : "false");
    send_line(&line);
  }
}

/* Wait until a publisher that the probe listens to is matched with another process.
 *
 * Only with a node's first one on the topic: a node that makes a new publisher for every message
 * loses them.
 */
static void hold(const rcl_publisher_t * publisher, const rcl_node_t * node, const char * topic)
{
  static char held[64][512];
  static int keys;
  char key[512];
  if (!active || !topic || !is_listened_to(topic)) {
    return;
  }
  snprintf(key, sizeof(key), "%s %s", CALL(rcl_node_get_fully_qualified_name)(node), topic);
  size_t own = 0;
  pthread_mutex_lock(&lock);
  for (int i = 0; i < keys; ++i) {
    if (strcmp(held[i], key) == 0) {
      pthread_mutex_unlock(&lock);
      return;
    }
  }
  if (keys < 64) {
    memcpy(held[keys++], key, sizeof(key));
  }
  entity_t * one = find(publisher);
  if (one) {
    one->is_held = true;
  }
  for (entity_t * each = entities; each < entities + MOST_ENTITIES; ++each) {
    own += each->handle && strcmp(each->kind, "subscription") == 0 &&
      strcmp(each->serves, topic) == 0;
  }
  pthread_mutex_unlock(&lock);
  int64_t began = now_ns(CLOCK_MONOTONIC), waited = 0;
  size_t matched = 0;
  while (CALL(rcl_publisher_get_subscription_count)(publisher, &matched) == RCL_RET_OK &&
    matched <= own && waited < HOLD_LIMIT_MS * MS)
  {
    nanosleep(&(struct timespec){.tv_nsec = HOLD_POLL_MS * MS}, NULL);
    waited = now_ns(CLOCK_MONOTONIC) - began;
  }
  line_t line = begin("held");
  add_text(&line, "topic", topic);
  add(&line, ", \"waited_s\": %.6f, \"matched\": %s", waited / 1e9, matched > own ? "true" : "false");
  send_line(&line);
}

PUBLIC rcl_ret_t rcl_publisher_init(
  rcl_publisher_t * publisher, const rcl_node_t * node,
  const rosidl_message_type_support_t * type_support, const char * topic_name,
  const rcl_publisher_options_t * options)
{
  REAL(rcl_publisher_init, "librcl.so");
  rcl_ret_t result = next(publisher, node, type_support, topic_name, options);
  if (result == RCL_RET_OK) {
    const char * topic = CALL(rcl_publisher_get_topic_name)(publisher);
    report_endpoint(publisher, "publisher", node, topic, type_support, &options->qos);
    hold(publisher, node, topic);
  }
  return result;
}

PUBLIC rcl_ret_t rcl_subscription_init(
  rcl_subscription_t * subscription, const rcl_node_t * node,
  const rosidl_message_type_support_t * type_support, const char * topic_name,
  const rcl_subscription_options_t * options)
{
  REAL(rcl_subscription_init, "librcl.so");
  rcl_ret_t result = next(subscription, node, type_support, topic_name, options);
  if (result == RCL_RET_OK) {
    const char * topic = CALL(rcl_subscription_get_topic_name)(subscription);
    report_endpoint(subscription, "subscription", node, topic, type_support, &options->qos);
  }
  return result;
}

/* A program that ends destroys its endpoints before its nodes; while it spins, one destroys what
 * it does not need any more. */
PUBLIC rcl_ret_t rcl_publisher_fini(rcl_publisher_t * publisher, rcl_node_t * node)
{
  REAL(rcl_publisher_fini, "librcl.so");
  if (!spinning) {
    flush();
  }
  forget(publisher);
  return next(publisher, node);
}

PUBLIC rcl_ret_t rcl_subscription_fini(rcl_subscription_t * subscription, rcl_node_t * node)
{
  REAL(rcl_subscription_fini, "librcl.so");
  if (!spinning) {
    flush();
  }
  forget(subscription);
  return next(subscription, node);
}

PUBLIC rcl_ret_t rcl_service_init(
  rcl_service_t * service, const rcl_node_t * node,
  const rosidl_service_type_support_t * type_support, const char * service_name,
  const rcl_service_options_t * options)
{
  REAL(rcl_service_init, "librcl.so");
  rcl_ret_t result = next(service, node, type_support, service_name, options);
  if (result == RCL_RET_OK && active) {
    pthread_mutex_lock(&lock);
    keep(service, "service", CALL(rcl_service_get_service_name)(service));
    pthread_mutex_unlock(&lock);
  }
  return result;
}

PUBLIC rcl_ret_t rcl_service_fini(rcl_service_t * service, rcl_node_t * node)
{
  REAL(rcl_service_fini, "librcl.so");
  forget(service);
  return next(service, node);
}

static void report_timer(const rcl_timer_t * timer, int64_t period)
{
  char serves[64];
  if (!active) {
    return;
  }
  snprintf(serves, sizeof(serves), "%g s", period / 1e9);
  pthread_mutex_lock(&lock);
  entity_t * one = keep(timer, "timer", serves);
  int number = one ? one->number : -1;
  pthread_mutex_unlock(&lock);
  line_t line = begin("timer");
  add(&line, ", \"number\": %d, \"period_s\": %.9g", number, period / 1e9);
  send_line(&line);
}

PUBLIC rcl_ret_t rcl_timer_init2(
  rcl_timer_t * timer, rcl_clock_t * clock, rcl_context_t * context, int64_t period,
  const rcl_timer_callback_t callback, rcl_allocator_t allocator, bool autostart)
{
  REAL(rcl_timer_init2, "librcl.so");
  rcl_ret_t result = next(timer, clock, context, period, callback, allocator, autostart);
  if (result == RCL_RET_OK) {
    report_timer(timer, period);
  }
  return result;
}

PUBLIC rcl_ret_t rcl_timer_fini(rcl_timer_t * timer)
{
  REAL(rcl_timer_fini, "librcl.so");
  forget(timer);
  return next(timer);
}

/* Callbacks: an executor calls them between two tracepoints */

typedef struct
{
  int64_t began;
  int beside; /* How many others ran when it began. */
  unsigned long number;
} run_t;

static _Thread_local int depth;
static _Thread_local run_t runs[DEEPEST];
static atomic_int running;
static atomic_ulong begun_runs;
static atomic_bool calls_by_events;

PUBLIC rcl_ret_t rcl_take(
  const rcl_subscription_t * subscription, void * message, rmw_message_info_t * info,
  rmw_subscription_allocation_t * allocation)
{
  REAL(rcl_take, "librcl.so");
  rcl_ret_t result = next(subscription, message, info, allocation);
  if (result == RCL_RET_OK && active && !spinning) {
    pthread_mutex_lock(&lock);
    entity_t * one = find(subscription);
    if (one) {
      one->is_taken_from = true;
    }
    pthread_mutex_unlock(&lock);
  }
  return result;
}

static void report_spin(const char * executor, size_t threads)
{
  line_t line = begin("spin");
  add_text(&line, "executor", executor);
  add(&line, ", \"threads\": %zu", threads);
  send_line(&line);
}

#define NONE_READY(set, kind) memset(set->kind, 0, set->size_of_##kind * sizeof(*set->kind));

PUBLIC rcl_ret_t rcl_wait(rcl_wait_set_t * wait_set, int64_t timeout)
{
  static atomic_bool is_reported;
  REAL(rcl_wait, "librcl.so");
  /* A program without rclcpp is its own executor. */
  if (active && !atomic_exchange(&is_reported, true) &&
    !dlopen("librclcpp.so", RTLD_LAZY | RTLD_NOLOAD))
  {
    report_spin("SingleThreadedExecutor", 1);
  }
  if (is_paused() && pause_executor(timeout)) {
    /* What is not ready is removed. */
    NONE_READY(wait_set, subscriptions)
    NONE_READY(wait_set, guard_conditions)
    NONE_READY(wait_set, timers)
    NONE_READY(wait_set, clients)
    NONE_READY(wait_set, services)
    NONE_READY(wait_set, events)
    return RCL_RET_TIMEOUT;
  }
  return next(wait_set, timeout);
}

/* Tracepoints of the package tracetools: nothing else listens to them in a cell */

void ros_trace_callback_start(const void * callback, bool is_intra_process);
void ros_trace_callback_end(const void * callback);

PUBLIC void ros_trace_callback_start(const void * callback, bool is_intra_process)
{
  (void)callback;
  (void)is_intra_process;
  int beside = running++;
  unsigned long number = ++begun_runs;
  if (depth < DEEPEST) {
    runs[depth] = (run_t){now_ns(CLOCK_REALTIME), beside, number};
  }
  ++depth;
}

static const char * group_type(const void * group);

PUBLIC void ros_trace_callback_end(const void * callback)
{
  int64_t ended = now_ns(CLOCK_REALTIME);
  --running;
  depth -= depth > 0;
  if (!active || depth >= DEEPEST) {
    return;
  }
  run_t run = runs[depth];
  pthread_mutex_lock(&lock);
  entity_t * one = of_callback(callback);
  bool is_long = ended - run.began >= SHORT_NS;
  bool overlaps = run.beside > 0 || begun_runs != run.number;
  unsigned long number = one ? ++one->calls[overlaps] : 0;
  bool is_told = one && !is_own(one->serves) && strncmp(one->symbol, "rclcpp::", 8) != 0 &&
    (is_long || !(number & (number - 1)) || (overlaps && number <= FIRST_SHORT)) &&
    reported_runs++ < MOST_RUNS;
  line_t line = begin("ran");
  if (is_told) {
    add_text(&line, "callback", one->symbol);
    add_text(&line, "serves", one->serves);
    add(&line, ", \"group\": \"%s %ld\"", group_type(one->group), (long)(intptr_t)one->group);
  }
  pthread_mutex_unlock(&lock);
  if (is_told) {
    add(&line, ", \"thread\": %ld", (long)syscall(SYS_gettid));
    add(&line, ", \"began_ns\": %lld", (long long)run.began);
    add(&line, ", \"ended_ns\": %lld", (long long)ended);
    send_line(&line);
  }
  if (calls_by_events && is_paused()) {
    /* An executor that does not use rcl_wait(). */
    pause_executor(-1);
  }
}

bool ros_trace_enabled_rclcpp_callback_register(void);
void ros_trace_do_rclcpp_callback_register(const void * callback, const char * symbol);
void ros_trace_rclcpp_callback_register(const void * callback, const char * symbol);
void ros_trace_rclcpp_timer_callback_added(const void * timer_handle, const void * callback);
void ros_trace_rclcpp_service_callback_added(const void * service_handle, const void * callback);
void ros_trace_rclcpp_subscription_init(const void * handle, const void * subscription);
void ros_trace_rclcpp_subscription_callback_added(const void * subscription, const void * callback);

PUBLIC bool ros_trace_enabled_rclcpp_callback_register(void)
{
  return active;
}

PUBLIC void ros_trace_do_rclcpp_callback_register(const void * callback, const char * symbol)
{
  pthread_mutex_lock(&lock);
  entity_t * one = of_callback(callback);
  /* Of std::bind(&Class::method, this) only the class is known. */
  const char * class = symbol && strncmp(symbol, "std::_Bind<", 11) == 0 ? strchr(symbol, '(') : NULL;
  const char * end = class ? strstr(class, "::*(") : NULL;
  if (one && end) {
    snprintf(one->symbol, sizeof(one->symbol), "method of %.*s", (int)(end - class) - 1, class + 1);
  } else if (one) {
    snprintf(one->symbol, sizeof(one->symbol), "%s", symbol ? symbol : "");
  }
  pthread_mutex_unlock(&lock);
}

PUBLIC void ros_trace_rclcpp_callback_register(const void * callback, const char * symbol)
{
  ros_trace_do_rclcpp_callback_register(callback, symbol);
}

static void join(entity_t * one, const void * callback)
{
  if (one) {
    one->callback = callback;
  }
}

PUBLIC void ros_trace_rclcpp_timer_callback_added(const void * timer_handle, const void * callback)
{
  pthread_mutex_lock(&lock);
  join(find(timer_handle), callback);
  pthread_mutex_unlock(&lock);
}

PUBLIC void ros_trace_rclcpp_service_callback_added(
  const void * service_handle, const void * callback)
{
  pthread_mutex_lock(&lock);
  join(find(service_handle), callback);
  pthread_mutex_unlock(&lock);
}

PUBLIC void ros_trace_rclcpp_subscription_init(const void * handle, const void * subscription)
{
  pthread_mutex_lock(&lock);
  entity_t * one = find(handle);
  if (one) {
    one->owner = subscription;
  }
  pthread_mutex_unlock(&lock);
}

PUBLIC void ros_trace_rclcpp_subscription_callback_added(
  const void * subscription, const void * callback)
{
  pthread_mutex_lock(&lock);
  join(of_owner(subscription), callback);
  pthread_mutex_unlock(&lock);
}

/* librclcpp: executors and callback groups, by the names that its compiler gave the functions.
 *
 * A parameter of a class type that is not trivially copyable, such as a std::shared_ptr, is passed
 * as a pointer, a std::chrono::nanoseconds as an int64_t (Itanium C++ ABI).
 */

#define CPP(result, name, symbol, ...) \
  result name(__VA_ARGS__) __asm__(symbol); \
  PUBLIC result name(__VA_ARGS__)

#define CPP_NEXT(symbol, ...) \
  static void (* next)(__VA_ARGS__); \
  if (next == NULL) {next = (void (*)(__VA_ARGS__))real(symbol, "librclcpp.so");}

typedef struct
{
  const void * object;
  long value;
} property_t;

static property_t thread_numbers[64], group_types[256];

static void set_property(property_t * all, size_t most, const void * object, long value)
{
  pthread_mutex_lock(&lock);
  for (size_t i = 0; i < most; ++i) {
    if (all[i].object == object || all[i].object == NULL) {
      all[i] = (property_t){object, value};
      break;
    }
  }
  pthread_mutex_unlock(&lock);
}

static long property(const property_t * all, size_t most, const void * object, long otherwise)
{
  for (size_t i = 0; i < most && all[i].object; ++i) {
    if (all[i].object == object) {
      return all[i].value;
    }
  }
  return otherwise;
}

static const char * group_type(const void * group)
{
  return property(group_types, 256, group, 0) ? "ReentrantCallbackGroup" :
         "MutuallyExclusiveCallbackGroup";
}

CPP(unsigned, hardware_concurrency, "_ZNSt6thread20hardware_concurrencyEv", void)
{
  long cpus = sysconf(_SC_NPROCESSORS_ONLN);
  return cpus > LEAST_THREADS || !active ? (unsigned)cpus : LEAST_THREADS;
}

#define MULTI_THREADED "_ZN6rclcpp9executors21MultiThreadedExecutorC1ERKNS_15ExecutorOptionsEmb" \
  "NSt6chrono8durationIlSt5ratioILl1ELl1000000000EEEE"

CPP(void, make_multi_threaded, MULTI_THREADED,
  void * executor, const void * options, size_t threads, bool yields, int64_t timeout)
{
  CPP_NEXT(MULTI_THREADED, void *, const void *, size_t, bool, int64_t);
  next(executor, options, threads, yields, timeout);
  set_property(thread_numbers, 64, executor, threads ? (long)threads : hardware_concurrency());
  line_t line = begin("made");
  add_text(&line, "executor", "MultiThreadedExecutor");
  send_line(&line);
}

static void stop_spinning(const int * unused)
{
  (void)unused;
  --spinning;
}

static void begin_spinning(const void * executor, const char * kind)
{
  static property_t reported[64];
  ++spinning;
  calls_by_events = calls_by_events || strcmp(kind, "EventsExecutor") == 0;
  /* rclcpp::spin_some(node) makes an executor each time, perhaps at the same place. */
  if (!property(reported, 64, executor, 0)) {
    set_property(reported, 64, executor, 1);
    report_spin(kind, (size_t)property(thread_numbers, 64, executor, 1));
  }
}

/* A callback that throws leaves through these functions: the end is noted by a cleanup. */
#define SPIN(name, symbol, kind, parameters, arguments) \
  CPP(void, name, symbol, parameters) \
  { \
    CPP_NEXT(symbol, parameters); \
    __attribute__((cleanup(stop_spinning))) const int spins = 1; \
    (void)spins; \
    begin_spinning(executor, kind); \
    next arguments; \
  }

#define LIST(...) __VA_ARGS__
#define NANOSECONDS "NSt6chrono8durationIlSt5ratioILl1ELl1000000000EEEE"

SPIN(spin_single, "_ZN6rclcpp9executors22SingleThreadedExecutor4spinEv",
  "SingleThreadedExecutor", LIST(void * executor), (executor))
SPIN(spin_multi, "_ZN6rclcpp9executors21MultiThreadedExecutor4spinEv",
  "MultiThreadedExecutor", LIST(void * executor), (executor))
SPIN(spin_static, "_ZN6rclcpp9executors28StaticSingleThreadedExecutor4spinEv",
  "StaticSingleThreadedExecutor", LIST(void * executor), (executor))
SPIN(spin_events, "_ZN6rclcpp12experimental9executors14EventsExecutor4spinEv",
  "EventsExecutor", LIST(void * executor), (executor))
SPIN(spin_once, "_ZN6rclcpp8Executor14spin_once_implE" NANOSECONDS,
  "SingleThreadedExecutor", LIST(void * executor, int64_t timeout), (executor, timeout))
SPIN(spin_some, "_ZN6rclcpp8Executor14spin_some_implE" NANOSECONDS "b",
  "SingleThreadedExecutor", LIST(void * executor, int64_t limit, bool exhaustive),
  (executor, limit, exhaustive))

#define CALLBACK_GROUP "_ZN6rclcpp13CallbackGroupC1ENS_17CallbackGroupTypeESt8weak_ptrINS_7ContextEEb"

CPP(void, make_group, CALLBACK_GROUP, void * group, int type, void * context, bool is_added)
{
  CPP_NEXT(CALLBACK_GROUP, void *, int, void *, bool);
  next(group, type, context, is_added);
  set_property(group_types, 256, group, type);
}

/* What is given to a group was created by the same thread just before. */
#define ADD_TO_GROUP(name, symbol) \
  CPP(void, name, symbol, void * group, void * entity) \
  { \
    CPP_NEXT(symbol, void *, void *); \
    next(group, entity); \
    if (newest) { \
      newest->group = group; \
    } \
  }

ADD_TO_GROUP(add_timer, "_ZN6rclcpp13CallbackGroup9add_timerESt10shared_ptrINS_9TimerBaseEE")
ADD_TO_GROUP(add_subscription,
  "_ZN6rclcpp13CallbackGroup16add_subscriptionESt10shared_ptrINS_16SubscriptionBaseEE")
ADD_TO_GROUP(add_service, "_ZN6rclcpp13CallbackGroup11add_serviceESt10shared_ptrINS_11ServiceBaseEE")

/* Crashes */

static const int FATAL[] = {SIGSEGV, SIGABRT, SIGFPE, SIGILL, SIGBUS};
static const char * const FATAL_WORDS[] = {
  "SIGSEGV (segmentation fault)", "SIGABRT (abort)", "SIGFPE (arithmetic error)",
  "SIGILL (illegal instruction)", "SIGBUS (bus error)"};

static void say(const char * format, ...)
{
  /* snprintf() of texts and integers allocates nothing. */
  char text[1024];
  va_list arguments;
  va_start(arguments, format);
  int length = vsnprintf(text, sizeof(text), format, arguments);
  va_end(arguments);
  ssize_t written = write(
    STDERR_FILENO, text, length < (int)sizeof(text) ? (size_t)length : sizeof(text) - 1);
  (void)written;
}

/* Whether a line of addr2line is about code of the student's, not of a header that it includes. */
static bool is_of_student(char * text)
{
  char * place = strstr(text, " at "), * note = strstr(text, " (discriminator");
  if (note) {
    *note = '\0';
  }
  if (!place || text[0] == '?') {
    return false;
  }
  if (place[4] == '?') {
    /* Without debugging information there are names only. */
    return text[0] != '_' && !strstr(text, "std::") && !strstr(text, "rclcpp::");
  }
  return place[4] != '/' || !strstr(place, "/include/");
}

/* Run addr2line; _Fork() takes no lock that a crashed malloc() may hold. */
static void symbols(
  const char * object, char addresses[][24], int number, char * text, size_t size)
{
  char * arguments[MOST_FRAMES + 4] = {"addr2line", "-Cfpe", (char *)object};
  int ends[2];
  text[0] = '\0';
  if (pipe2(ends, O_CLOEXEC) != 0) {
    return;
  }
  for (int i = 0; i < number; ++i) {
    arguments[3 + i] = addresses[i];
  }
  pid_t child = _Fork();
  if (child == 0) {
    dup2(ends[1], STDOUT_FILENO);
    dup2(open("/dev/null", O_WRONLY), STDERR_FILENO);
    execve("/usr/bin/addr2line", arguments, (char *[]){NULL});
    _exit(127);
  }
  close(ends[1]);
  size_t length = 0;
  int64_t limit = now_ns(CLOCK_MONOTONIC) + SYMBOLS_LIMIT_MS * MS;
  while (child > 0 && length < size - 1) {
    int64_t left_ms = (limit - now_ns(CLOCK_MONOTONIC)) / MS;
    struct pollfd readable = {.fd = ends[0], .events = POLLIN};
    if (left_ms <= 0 || poll(&readable, 1, (int)left_ms) <= 0) {
      kill(child, SIGKILL);
      break;
    }
    ssize_t more = read(ends[0], text + length, size - 1 - length);
    if (more <= 0) {
      break;
    }
    length += (size_t)more;
  }
  text[length] = '\0';
  close(ends[0]);
}

/* File of the student's that an address is in: the program, or a library installed with it. */
static const char * own_object(const void * address, uintptr_t * offset)
{
  Dl_info found;
  struct link_map * map = NULL;
  if (dladdr1(address, &found, (void **)&map, RTLD_DL_LINKMAP) == 0 || map == NULL) {
    return NULL;
  }
  /* A return address lies behind the call. */
  *offset = (uintptr_t)address - map->l_addr - 1;
  if (map->l_name[0] == '\0') {
    return program; /* It has no name in its map. */
  }
  const char * installed = strstr(program, "/lib/");
  size_t prefix = installed ? (size_t)(installed - program) + 1 : sizeof(program);
  return strncmp(program, map->l_name, prefix) == 0 ? map->l_name : NULL;
}

static void show_frames(void)
{
  static char text[32768], addresses[MOST_FRAMES][24];
  void * frames[MOST_FRAMES];
  int number = backtrace(frames, MOST_FRAMES), waiting = 0, shown = 0;
  const char * object = NULL;
  for (int i = 0; i <= number; ++i) {
    uintptr_t offset = 0;
    const char * next = i < number ? own_object(frames[i], &offset) : NULL;
    if (waiting && (i == number || (next && next != object))) {
      symbols(object, addresses, waiting, text, sizeof(text));
      char * rest = text;
      for (char * line; shown < MOST_SHOWN && (line = strsep(&rest, "\n")); ) {
        if (is_of_student(line)) {
          say("rosgrade:   #%d %s\n", shown++, line);
        }
      }
      waiting = 0;
    }
    if (next) {
      object = next;
      snprintf(addresses[waiting++], sizeof(addresses[0]), "0x%lx", (unsigned long)offset);
    }
  }
}

static void on_crash(int number)
{
  static atomic_bool is_told;
  if (!atomic_exchange(&is_told, true)) {
    const char * name = strrchr(program, '/');
    for (size_t i = 0; i < sizeof(FATAL) / sizeof(*FATAL); ++i) {
      if (FATAL[i] == number) {
        say("rosgrade: %s in %s\n", FATAL_WORDS[i], name ? name + 1 : program);
      }
    }
    show_frames();
    await_seen();
  }
  /* SA_RESETHAND: this time it has its usual effect. */
  raise(number);
}

static void catch_crashes(void)
{
  static char stack[1 << 16];
  void * frames[1];
  /* The first call of backtrace() loads a library. */
  backtrace(frames, 1);
  sigaltstack(&(stack_t){.ss_sp = stack, .ss_size = sizeof(stack)}, NULL);
  struct sigaction action = {.sa_handler = on_crash, .sa_flags = SA_ONSTACK | SA_RESETHAND};
  for (size_t i = 0; i < sizeof(FATAL) / sizeof(*FATAL); ++i) {
    sigaction(FATAL[i], &action, NULL);
  }
}

/* Begin and end of the process */

static int number_in(const char * variable)
{
  const char * text = getenv(variable);
  return text ? atoi(text) : -1;
}

__attribute__((constructor)) static void start(void)
{
  const char * inode = getenv("ROSGRADE_TRACER_PIPE");
  ssize_t length = readlink("/proc/self/exe", program, sizeof(program) - 1);
  program[length > 0 ? length : 0] = '\0';
  const char * name = strrchr(program, '/');
  bool is_python = name && strncmp(name + 1, "python", 6) == 0;
  /* Programs of the system, such as a shell, pass it on to what they start. */
  bool is_system = strncmp(program, "/usr/", 5) == 0 && !is_python;
  bool speaks = is_python ? number_in("ROSGRADE_TRACER_PYTHON") == 1 : !is_system;
  tracer_fd = number_in("ROSGRADE_TRACER_FD");
  seen_fd = number_in("ROSGRADE_SEEN_FD");
  pause_fd = number_in("ROSGRADE_PAUSE_FD");
  if (!speaks || !inode || !is_pipe(tracer_fd, &tracer_pipe) ||
    tracer_pipe.st_ino != strtoul(inode, NULL, 10))
  {
    return;
  }
  active = true;
  pause_fd = is_pipe(pause_fd, &pause_pipe) ? pause_fd : -1;
  held_topics = getenv("ROSGRADE_HOLD");
  held_topics = strdup(held_topics ? held_topics : "");
  keep_environment();
  line_t line = begin("started");
  add_text(&line, "executable", program);
  add_text(&line, "language", "C++");
  send_line(&line);
  if (!is_python) {
    /* As in a terminal: what is printed must be dated when it is printed. */
    setvbuf(stdout, NULL, _IOLBF, 0);
    catch_crashes();
  }
}

__attribute__((destructor)) static void end(void)
{
  line_t line = begin("exiting");
  send_line(&line);
}
