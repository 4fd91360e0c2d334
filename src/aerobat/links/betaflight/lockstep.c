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
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { MOTORS_PORT = 9002, MOTORS_RAW_PORT = 9001, STATE_PORT = 9003, RC_PORT = 9004, SERIAL_PORT = 5761 };
enum { STATE_SIZE = 144, RC_SIZE = 40, LAST_SERIAL_PORT = 5770 };

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

struct inbox {
    int fd, is_full, is_awaited;
    size_t size;
    char packet[STATE_SIZE];
};

static pthread_t main_thread;
static int orders = -1;
static uint64_t now = 1000000000, until = 0;  // [ns]
static struct answer answer;
static struct inbox state = {-1, 0, 0, STATE_SIZE, {0}}, rc = {-1, 0, 0, RC_SIZE, {0}};
static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t changed = PTHREAD_COND_INITIALIZER;

__attribute__((constructor)) static void begin(void)
{
    const char *fd = getenv("AEROBAT_ORDERS");
    main_thread = pthread_self();
    orders = fd ? atoi(fd) : -1;
}

// Hands a packet to the thread that waits for it, and waits until that thread has worked on it.
static void deliver(struct inbox *inbox, const char *packet)
{
    pthread_mutex_lock(&mutex);
    while (!inbox->is_awaited) pthread_cond_wait(&changed, &mutex);
    memcpy(inbox->packet, packet, inbox->size);
    inbox->is_full = 1;
    inbox->is_awaited = 0;
    pthread_cond_broadcast(&changed);
    while (!inbox->is_awaited) pthread_cond_wait(&changed, &mutex);
    pthread_mutex_unlock(&mutex);
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

static struct inbox *inbox_of(int fd)
{
    return fd >= 0 && fd == state.fd ? &state : fd >= 0 && fd == rc.fd ? &rc : NULL;
}

int select(int count, fd_set *reads, fd_set *writes, fd_set *errors, struct timeval *timeout)
{
    static int (*next)(int, fd_set *, fd_set *, fd_set *, struct timeval *);
    if (!next) next = dlsym(RTLD_NEXT, "select");
    struct inbox *inbox = reads && FD_ISSET(count - 1, reads) ? inbox_of(count - 1) : NULL;
    if (!inbox) return next(count, reads, writes, errors, timeout);
    pthread_mutex_lock(&mutex);
    inbox->is_awaited = 1;
    pthread_cond_broadcast(&changed);
    while (!inbox->is_full) pthread_cond_wait(&changed, &mutex);
    pthread_mutex_unlock(&mutex);
    return 1;
}

ssize_t recvfrom(int fd, void *data, size_t size, int flags, struct sockaddr *from, socklen_t *length)
{
    static ssize_t (*next)(int, void *, size_t, int, struct sockaddr *, socklen_t *);
    if (!next) next = dlsym(RTLD_NEXT, "recvfrom");
    struct inbox *inbox = inbox_of(fd);
    if (!inbox) return next(fd, data, size, flags, from, length);
    pthread_mutex_lock(&mutex);
    size = size < inbox->size ? size : inbox->size;
    memcpy(data, inbox->packet, size);
    inbox->is_full = 0;
    pthread_mutex_unlock(&mutex);
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
    }
    if (port == MOTORS_PORT || port == MOTORS_RAW_PORT) return size;
    return next(fd, data, size, flags, to, length);
}
