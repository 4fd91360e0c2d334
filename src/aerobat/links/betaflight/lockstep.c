// Betaflight's simulator target under a clock of its own, in step with whoever simulates its vehicle.
//
// The firmware takes time from clock_gettime and nanosleep and its simulated world from UDP packets. Loaded
// before the C library (LD_PRELOAD), the functions below answer instead. Time is counted, not measured: it
// advances as the main loop sleeps, and stops at each end of a step until the next step is ordered. Orders and
// answers go over one inherited socket, so no UDP port is taken, and the firmware ends when the socket does.
// The port of its first serial line becomes AEROBAT_SERIAL_PORT; other lines get free ports.

#define _GNU_SOURCE
#include <arpa/inet.h>
#include <dlfcn.h>
#include <pthread.h>
#include <semaphore.h>
#include <signal.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <time.h>
#include <ucontext.h>
#include <unistd.h>

enum { MOTORS_PORT = 9002, MOTORS_RAW_PORT = 9001, STATE_PORT = 9003, RC_PORT = 9004, SERIAL_PORT = 5761 };
enum { STATE_SIZE = 144, RC_SIZE = 40, LAST_SERIAL_PORT = 5770, STACK_SIZE = 1 << 18 };

static const uint64_t READING_TAKES = 250;  // [ns] of a look at the clock, so that loops that wait for it end

struct order {
    uint64_t duration;  // [ns]
    uint32_t has_state, has_rc;
    char state[STATE_SIZE], rc[RC_SIZE];
};

struct answer {
    uint64_t time;    // [ns]
    uint32_t packets;  // of motors in the step
    float motors[4];
};

// A thread of the firmware that waits for packets, run as a coroutine of its main thread.
struct receiver {
    int fd, is_full;
    size_t size;
    char packet[STATE_SIZE];
    void *(*work)(void *);
    void *argument;
    ucontext_t own, caller;
    char stack[STACK_SIZE];
};

static pthread_t main_thread;
static int orders = -1, threads = 0;
static uint64_t now = 1000000000, until = 0;  // [ns]
static struct answer answer;
static struct receiver state = {.fd = -1, .size = STATE_SIZE}, rc = {.fd = -1, .size = RC_SIZE};

__attribute__((constructor)) static void begin(void)
{
    const char *fd = getenv("AEROBAT_ORDERS");
    main_thread = pthread_self();
    prctl(PR_SET_PDEATHSIG, SIGKILL);  // should it not come to read that its orders have ended
    orders = fd ? atoi(fd) : -1;
}

// The serial lines' thread frees any line that is not yet open, so it begins when all are: with the first motors.
static sem_t lines_are_open;
static struct { void *(*work)(void *); void *argument; } serial;

static void *serve_serial(void *nothing)
{
    (void)nothing;
    while (sem_wait(&lines_are_open)) {}
    return serial.work(serial.argument);
}

static void work_on_state(void) { state.work(state.argument); }
static void work_on_rc(void) { rc.work(rc.argument); }

// The first thread serves serial lines and is one; the second and third wait for states and for channels.
int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*work)(void *), void *argument)
{
    static int (*next)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
    if (!next) next = dlsym(RTLD_NEXT, "pthread_create");
    int number = ++threads;
    if (number == 1) {
        serial.work = work;
        serial.argument = argument;
        sem_init(&lines_are_open, 0, 0);
        return next(thread, attributes, serve_serial, NULL);
    }
    if (number != 2 && number != 3) return next(thread, attributes, work, argument);
    struct receiver *receiver = number == 2 ? &state : &rc;
    receiver->work = work;
    receiver->argument = argument;
    getcontext(&receiver->own);
    receiver->own.uc_stack.ss_sp = receiver->stack;
    receiver->own.uc_stack.ss_size = STACK_SIZE;
    receiver->own.uc_link = &receiver->caller;
    makecontext(&receiver->own, number == 2 ? work_on_state : work_on_rc, 0);
    swapcontext(&receiver->caller, &receiver->own);  // until it waits
    *thread = main_thread;
    return 0;
}

int pthread_join(pthread_t thread, void **result)
{
    static int (*next)(pthread_t, void **);
    if (!next) next = dlsym(RTLD_NEXT, "pthread_join");
    return pthread_equal(thread, main_thread) ? 0 : next(thread, result);
}

// Has a receiver work on a packet until it waits for the next.
static void deliver(struct receiver *receiver, const char *packet)
{
    memcpy(receiver->packet, packet, receiver->size);
    receiver->is_full = 1;
    swapcontext(&receiver->caller, &receiver->own);
}

static void end_step(void)
{
    struct order order;
    answer.time = now;
    if (until && send(orders, &answer, sizeof answer, MSG_NOSIGNAL) != sizeof answer) _exit(0);
    if (recv(orders, &order, sizeof order, MSG_WAITALL) != sizeof order) _exit(0);
    answer.packets = 0;
    until = (until ? until : now) + order.duration;
    if (order.has_rc) deliver(&rc, order.rc);
    if (order.has_state) deliver(&state, order.state);
}

int clock_gettime(clockid_t id, struct timespec *time)
{
    (void)id;
    if (pthread_equal(pthread_self(), main_thread)) now += READING_TAKES;
    time->tv_sec = now / 1000000000;
    time->tv_nsec = now % 1000000000;
    return 0;
}

int nanosleep(const struct timespec *wanted, struct timespec *left)
{
    (void)left;
    if (!pthread_equal(pthread_self(), main_thread) || orders < 0)
        return clock_nanosleep(CLOCK_MONOTONIC, 0, wanted, NULL);
    now += wanted->tv_sec * 1000000000ull + wanted->tv_nsec;
    while (now >= until) end_step();
    return 0;
}

int bind(int fd, const struct sockaddr *address, socklen_t size)
{
    static int (*next)(int, const struct sockaddr *, socklen_t);
    if (!next) next = dlsym(RTLD_NEXT, "bind");
    if (address->sa_family != AF_INET) return next(fd, address, size);
    struct sockaddr_in own = *(const struct sockaddr_in *)address;
    int port = ntohs(own.sin_port);
    if (port == STATE_PORT || port == RC_PORT) {
        *(port == STATE_PORT ? &state.fd : &rc.fd) = fd;
        return 0;
    }
    if (port >= SERIAL_PORT && port <= LAST_SERIAL_PORT) {
        const char *serial = getenv("AEROBAT_SERIAL_PORT");
        own.sin_port = htons(serial && port == SERIAL_PORT ? atoi(serial) : 0);
        own.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    }
    return next(fd, (const struct sockaddr *)&own, sizeof own);
}

static struct receiver *receiver_of(int fd)
{
    return fd >= 0 && fd == state.fd ? &state : fd >= 0 && fd == rc.fd ? &rc : NULL;
}

int select(int count, fd_set *reads, fd_set *writes, fd_set *errors, struct timeval *timeout)
{
    static int (*next)(int, fd_set *, fd_set *, fd_set *, struct timeval *);
    if (!next) next = dlsym(RTLD_NEXT, "select");
    struct receiver *receiver = receiver_of(count - 1);
    if (!receiver) return next(count, reads, writes, errors, timeout);
    while (!receiver->is_full) swapcontext(&receiver->own, &receiver->caller);
    return 1;
}

ssize_t recvfrom(int fd, void *data, size_t size, int flags, struct sockaddr *from, socklen_t *length)
{
    static ssize_t (*next)(int, void *, size_t, int, struct sockaddr *, socklen_t *);
    if (!next) next = dlsym(RTLD_NEXT, "recvfrom");
    struct receiver *receiver = receiver_of(fd);
    if (!receiver) return next(fd, data, size, flags, from, length);
    size = size < receiver->size ? size : receiver->size;
    memcpy(data, receiver->packet, size);
    receiver->is_full = 0;
    return size;
}

ssize_t sendto(int fd, const void *data, size_t size, int flags, const struct sockaddr *to, socklen_t length)
{
    static ssize_t (*next)(int, const void *, size_t, int, const struct sockaddr *, socklen_t);
    if (!next) next = dlsym(RTLD_NEXT, "sendto");
    if (!to || to->sa_family != AF_INET) return next(fd, data, size, flags, to, length);
    int port = ntohs(((const struct sockaddr_in *)to)->sin_port);
    if (port == MOTORS_PORT && size == sizeof answer.motors) {
        memcpy(answer.motors, data, size);
        answer.packets++;
        static int running = 0;
        if (!running) sem_post(&lines_are_open);
        running = 1;
    }
    if (port == MOTORS_PORT || port == MOTORS_RAW_PORT) return size;
    return next(fd, data, size, flags, to, length);
}
