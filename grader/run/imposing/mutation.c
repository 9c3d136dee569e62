/* Imposes mistakes on a right program in C++: what `rosgrade selftest` grades as a mutant.
 *
 * It is preloaded before the tracer of compiled programs, so that functions of rcl's C API that are
 * defined here get what the program says, and give the tracer what a wrong program would have said.
 * The mistakes stand in the file beside it: a line for each, with the program, the kind, a name and
 * a value between tabs. imposing/sitecustomize.py imposes the same on programs of Python.
 */

#define _GNU_SOURCE

#include <dlfcn.h>
#include <limits.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include <rcl/client.h>
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
#define NEXT(name) \
  static __typeof__(&name) next; \
  if (next == NULL) {next = (__typeof__(&name))dlsym(RTLD_NEXT, #name);}

enum {MOST = 32, LONGEST = 512};

typedef struct
{
  char program[LONGEST], kind[LONGEST], name[LONGEST], value[LONGEST];
} mistake_t;

static mistake_t mistakes[MOST];
static int number;

/* The value of a mistake of this program, or NULL where it does not make it. */
static const char * mistake(const char * kind, const char * name)
{
  for (int i = 0; i < number; ++i) {
    if (strcmp(mistakes[i].kind, kind) == 0 && (!name || strcmp(mistakes[i].name, name) == 0)) {
      return mistakes[i].value;
    }
  }
  return NULL;
}

__attribute__((constructor)) static void start(void)
{
  static char program[PATH_MAX], place[PATH_MAX];
  ssize_t length = readlink("/proc/self/exe", program, sizeof(program) - 1);
  program[length > 0 ? length : 0] = '\0';
  const char * slash = strrchr(program, '/');
  Dl_info own;
  if (!slash || dladdr((void *)&mistakes, &own) == 0) {
    return;
  }
  snprintf(place, sizeof(place), "%s", own.dli_fname);
  snprintf(strrchr(place, '/') + 1, sizeof("mutation.txt"), "mutation.txt");
  FILE * file = fopen(place, "r");
  mistake_t * one = mistakes;
  while (file && number < MOST &&
    fscanf(file, "%511[^\t]\t%511[^\t]\t%511[^\t]\t%511[^\n]\n",
    one->program, one->kind, one->name, one->value) == 4)
  {
    number += strcmp(one->program, slash + 1) == 0;
    one = &mistakes[number];
  }
  if (file) {
    fclose(file);
  }
}

static void linger(void)
{
  while (true) {
    pause();
  }
}

static int64_t now_ns(void)
{
  struct timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return (int64_t)time.tv_sec * 1000000000 + time.tv_nsec;
}

static void sleep_s(double seconds)
{
  nanosleep(&(struct timespec){
    .tv_sec = (time_t)seconds, .tv_nsec = (long)((seconds - (time_t)seconds) * 1e9)}, NULL);
}

/* A type by its name, such as builtin_interfaces/msg/Time. */
static const rosidl_message_type_support_t * type_called(const char * type)
{
  char package[LONGEST], name[LONGEST], text[3 * LONGEST];
  if (sscanf(type, "%511[^/]/msg/%511s", package, name) != 2) {
    return NULL;
  }
  snprintf(text, sizeof(text), "lib%s__rosidl_typesupport_c.so", package);
  void * library = dlopen(text, RTLD_LAZY);
  snprintf(
    text, sizeof(text), "rosidl_typesupport_c__get_message_type_support_handle__%s__msg__%s",
    package, name);
  const rosidl_message_type_support_t * (* find)(void) =
    (const rosidl_message_type_support_t * (*)(void))(library ? dlsym(library, text) : NULL);
  return find ? find() : NULL;
}

/* Names */

static rcl_context_t * context;

PUBLIC rcl_ret_t rcl_node_init(
  rcl_node_t * node, const char * name, const char * namespace_, rcl_context_t * of,
  const rcl_node_options_t * options)
{
  NEXT(rcl_node_init)
  context = of;
  while (mistake("hangs", NULL)) {
    sleep_s(1.0);
  }
  if (mistake("lingers", NULL)) {
    atexit(linger);
  }
  if (mistake("ignores", NULL)) {
    signal(SIGINT, SIG_IGN);
  }
  const char * other = mistake("node", name), * moved = mistake("namespace", name);
  rcl_ret_t result = next(node, other ? other : name, moved ? moved : namespace_, of, options);
  const char * too = mistake("publishes", NULL);
  if (too && result == RCL_RET_OK) {
    static rcl_publisher_t publisher;
    rcl_publisher_options_t given = rcl_publisher_get_default_options();
    publisher = rcl_get_zero_initialized_publisher();
    result = rcl_publisher_init(
      &publisher, node, type_called("builtin_interfaces/msg/Time"), too, &given);
  }
  too = mistake("subscribes", NULL);
  if (too && result == RCL_RET_OK) {
    static rcl_subscription_t subscription;
    rcl_subscription_options_t given = rcl_subscription_get_default_options();
    subscription = rcl_get_zero_initialized_subscription();
    result = rcl_subscription_init(
      &subscription, node, type_called("builtin_interfaces/msg/Time"), too, &given);
  }
  return result;
}

/* Another name for what the program calls so, or the same. */
static const char * renamed(const rcl_node_t * node, const char * name, bool is_service, char * full)
{
  char * found = NULL;
  full[0] = '\0';
  if (rcl_node_resolve_name(
      node, name, rcl_get_default_allocator(), is_service, false, &found) == RCL_RET_OK)
  {
    snprintf(full, LONGEST, "%s", found);
    free(found);
  }
  const char * other = mistake("rename", full);
  return other ? other : name;
}

/* Quality of service and type */

static rmw_qos_profile_t requality(const rmw_qos_profile_t * asked, const char * topic)
{
  rmw_qos_profile_t qos = *asked;
  const char * reliability = mistake("reliability", topic);
  const char * durability = mistake("durability", topic), * depth = mistake("depth", topic);
  if (reliability) {
    qos.reliability = strcmp(reliability, "reliable") == 0 ?
      RMW_QOS_POLICY_RELIABILITY_RELIABLE : RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT;
  }
  if (durability) {
    qos.durability = strcmp(durability, "volatile") == 0 ?
      RMW_QOS_POLICY_DURABILITY_VOLATILE : RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL;
  }
  if (depth) {
    qos.history = RMW_QOS_POLICY_HISTORY_KEEP_LAST;
    qos.depth = strtoul(depth, NULL, 10);
  }
  return qos;
}

/* The type that a mistake says. */
static const rosidl_message_type_support_t * retyped(
  const char * topic, const rosidl_message_type_support_t * asked)
{
  const char * type = mistake("type", topic);
  const rosidl_message_type_support_t * other = type ? type_called(type) : NULL;
  return other ? other : asked;
}

/* What is published on */

typedef struct
{
  const void * publisher;
  const rosidl_message_type_support_t * type; /* As the program says. */
  char topic[LONGEST];
  atomic_ulong messages;
} topic_t;

static topic_t topics[MOST];

PUBLIC rcl_ret_t rcl_publisher_init(
  rcl_publisher_t * publisher, const rcl_node_t * node,
  const rosidl_message_type_support_t * type_support, const char * topic_name,
  const rcl_publisher_options_t * options)
{
  NEXT(rcl_publisher_init)
  static atomic_int count;
  char topic[LONGEST];
  const char * name = renamed(node, topic_name, false, topic);
  rcl_publisher_options_t changed = *options;
  changed.qos = requality(&options->qos, topic);
  if (count < MOST && topic[0]) {
    topic_t * one = &topics[count++];
    snprintf(one->topic, LONGEST, "%s", topic);
    one->type = type_support;
    one->publisher = publisher;
  }
  return next(publisher, node, retyped(topic, type_support), name, &changed);
}

PUBLIC rcl_ret_t rcl_subscription_init(
  rcl_subscription_t * subscription, const rcl_node_t * node,
  const rosidl_message_type_support_t * type_support, const char * topic_name,
  const rcl_subscription_options_t * options)
{
  NEXT(rcl_subscription_init)
  char topic[LONGEST];
  const char * name = renamed(node, topic_name, false, topic);
  rcl_subscription_options_t changed = *options;
  changed.qos = requality(&options->qos, topic);
  return next(subscription, node, retyped(topic, type_support), name, &changed);
}

PUBLIC rcl_ret_t rcl_service_init(
  rcl_service_t * service, const rcl_node_t * node,
  const rosidl_service_type_support_t * type_support, const char * service_name,
  const rcl_service_options_t * options)
{
  NEXT(rcl_service_init)
  char full[LONGEST];
  return next(service, node, type_support, renamed(node, service_name, true, full), options);
}

PUBLIC rcl_ret_t rcl_client_init(
  rcl_client_t * client, const rcl_node_t * node,
  const rosidl_service_type_support_t * type_support, const char * service_name,
  const rcl_client_options_t * options)
{
  NEXT(rcl_client_init)
  char full[LONGEST];
  return next(client, node, type_support, renamed(node, service_name, true, full), options);
}

/* Where a field is in the struct of a message, from the description of its type */

enum {NESTED = 1, LAST_SINGLE = 48, LAST_ARRAY = 96, BOOL = 15, STRING = 17};

typedef rosidl_runtime_c__type_description__TypeDescription description_t;
typedef rosidl_runtime_c__type_description__IndividualTypeDescription individual_t;

/* Sizes of FIELD_TYPE_INT8 ... FIELD_TYPE_BYTE; the alignment is the same. */
static const size_t SIZES[] = {0, 0, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8, 16, 1, 2, 1, 1};

static size_t aligned(size_t offset, size_t alignment)
{
  return (offset + alignment - 1) / alignment * alignment;
}

static const individual_t * described(const description_t * all, const char * name)
{
  for (size_t i = 0; i < all->referenced_type_descriptions.size; ++i) {
    if (strcmp(all->referenced_type_descriptions.data[i].type_name.data, name) == 0) {
      return &all->referenced_type_descriptions.data[i];
    }
  }
  return NULL;
}

typedef struct
{
  size_t size, alignment, offset; /* Of the whole, and of the field that was looked for. */
  uint8_t kind; /* Of that field; 0 if it was not found. */
} layout_t;

static layout_t layout(
  const description_t * all, const individual_t * one, bool is_cpp, const char * path)
{
  layout_t result = {.alignment = 1};
  size_t length = strcspn(path, ".");
  for (size_t i = 0; one && i < one->fields.size; ++i) {
    const char * name = one->fields.data[i].name.data;
    bool is_meant = path[0] && strlen(name) == length && strncmp(name, path, length) == 0;
    uint8_t kind = one->fields.data[i].type.type_id;
    uint8_t single = kind % LAST_SINGLE;
    layout_t field = {.size = is_cpp ? 32 : 24, .alignment = 8};
    if (single == NESTED) {
      const char * nested = one->fields.data[i].type.nested_type_name.data;
      const char * rest = is_meant && path[length] ? path + length + 1 : "";
      field = layout(all, described(all, nested), is_cpp, rest);
    } else if (single < STRING) {
      field.size = field.alignment = SIZES[single];
    }
    if (kind > LAST_ARRAY) {
      field.size = is_cpp && single == BOOL ? 40 : 24; /* A sequence. */
      field.alignment = 8;
    } else if (kind > LAST_SINGLE) {
      field.size *= one->fields.data[i].type.capacity;
    }
    result.size = aligned(result.size, field.alignment);
    if (is_meant && kind < LAST_SINGLE) {
      result.offset = result.size + field.offset;
      result.kind = path[length] ? field.kind : kind;
    }
    result.size += field.size;
    result.alignment = field.alignment > result.alignment ? field.alignment : result.alignment;
  }
  result.size = aligned(result.size, result.alignment);
  return result;
}

/* Place of a field in a message by its path, such as linear.x, and its size; NULL if there is none. */
static char * place_of(
  const topic_t * topic, const void * message, const char * path, uint8_t * kind, size_t * size)
{
  const description_t * all = topic->type->get_type_description_func(topic->type);
  bool is_cpp = strstr(topic->type->typesupport_identifier, "cpp") != NULL;
  layout_t found = layout(all, &all->type_description, is_cpp, path);
  char * place = (char *)message + found.offset;
  *kind = found.kind;
  *size = found.kind < STRING ? SIZES[found.kind] : 1;
  /* A string of either language begins with a pointer to its text. */
  return found.kind == 0 || found.kind > STRING ? NULL :
         found.kind == STRING ? *(char **)place : place;
}

static void make_other(char * place, uint8_t kind)
{
  switch (kind) {
    case 10: *(float *)place += 1.0f; break;
    case 11: *(double *)place += 1.0; break;
    case BOOL: *place = !*place; break;
    case STRING: *place = *place ? *place ^ 1 : '\0'; break;
    default: ++*place; /* The lowest byte of an integer. */
  }
}

/* Publish a message with another value in a field, or with its value in another field. */
static rcl_ret_t publish_wrong(
  __typeof__(&rcl_publish) next, const rcl_publisher_t * publisher, const void * message,
  const topic_t * topic)
{
  char path[LONGEST] = "", other[LONGEST] = "", kept[2][16];
  const char * fields = mistake("field", topic->topic);
  sscanf(fields ? fields : "", "%511s %511s", path, other);
  uint8_t kind = 0, kind_of_other = 0;
  size_t size = 0;
  char * from = place_of(topic, message, path, &kind, &size);
  char * to = other[0] ? place_of(topic, message, other, &kind_of_other, &size) : from;
  if (!from || !to || (to != from && kind != kind_of_other)) {
    return next(publisher, message, NULL);
  }
  memcpy(kept[0], from, size);
  memcpy(kept[1], to, size);
  if (to == from) {
    make_other(from, kind);
  } else {
    memset(from, 0, size);
    memcpy(to, kept[0], size);
  }
  rcl_ret_t result = next(publisher, message, NULL);
  memcpy(to, kept[1], size);
  memcpy(from, kept[0], size);
  return result;
}

PUBLIC rcl_ret_t rcl_publish(
  const rcl_publisher_t * publisher, const void * message, rmw_publisher_allocation_t * allocation)
{
  NEXT(rcl_publish)
  static const int64_t nothing[2]; /* A message of any type that a mistake says. */
  topic_t * topic = topics;
  while (topic < topics + MOST && topic->publisher != publisher) {
    ++topic;
  }
  if (topic == topics + MOST) {
    return next(publisher, message, allocation);
  }
  const char * most = mistake("most", topic->topic), * blocks = mistake("blocks", topic->topic);
  rcl_ret_t result = RCL_RET_OK;
  if (most && topic->messages++ >= strtoul(most, NULL, 10)) {
    return result;
  }
  if (mistake("type", topic->topic)) {
    result = next(publisher, nothing, allocation);
  } else if (mistake("field", topic->topic)) {
    result = publish_wrong(next, publisher, message, topic);
  } else {
    result = next(publisher, message, allocation);
  }
  if (mistake("twice", topic->topic)) {
    result = next(publisher, message, allocation);
  }
  if (blocks) {
    sleep_s(strtod(blocks, NULL));
  }
  return result;
}

/* Timers and executors */

PUBLIC rcl_ret_t rcl_timer_init2(
  rcl_timer_t * timer, rcl_clock_t * clock, rcl_context_t * of, int64_t period,
  const rcl_timer_callback_t callback, rcl_allocator_t allocator, bool autostart)
{
  NEXT(rcl_timer_init2)
  const char * times = mistake("period", NULL);
  period = times ? (int64_t)(period * strtod(times, NULL)) : period;
  return next(timer, clock, of, period, callback, allocator, autostart);
}

PUBLIC rcl_ret_t rcl_wait(rcl_wait_set_t * wait_set, int64_t timeout)
{
  NEXT(rcl_wait)
  static int64_t first_ns;
  const char * raises = mistake("raises", NULL);
  if (context && mistake("ends", NULL) && rcl_context_is_valid(context)) {
    rcl_ret_t ret = rcl_shutdown(context);
    (void)ret;
  }
  while (context && mistake("never_spins", NULL) && rcl_context_is_valid(context)) {
    sleep_s(0.02);
  }
  if (!raises) {
    return next(wait_set, timeout);
  }
  first_ns = first_ns ? first_ns : now_ns();
  int64_t left = first_ns + (int64_t)(strtod(raises, NULL) * 1e9) - now_ns();
  rcl_ret_t result = RCL_RET_TIMEOUT;
  if (left > 0) {
    result = next(wait_set, timeout >= 0 && timeout < left ? timeout : left);
  }
  return result == RCL_RET_TIMEOUT && (left <= 0 || timeout < 0) ? RCL_RET_ERROR : result;
}
