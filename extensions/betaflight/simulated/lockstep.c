/* Simulated time and local sockets for Betaflight's simulator target, loaded by LD_PRELOAD.

Time passes only in the main thread: by what it sleeps, and by READING_NS for each look at the
clock, so that waiting for a time ends. It goes no further than the newest state allows, whose time
stamp says how far; then the newest motor values are the answer, once a state. The other threads
move bytes in and out. They run one at a time, only while the main thread waits, and before time
goes on all bytes that were sent have been taken: the same bytes give the same flight.

A socket of port N is the Unix socket N in the working folder: nothing listens on a network. */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <dlfcn.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

enum { MOTORS_PORT = 9002, STATE_PORT = 9003, WORKERS = 3, READING_NS = 100 };
#define STARTED_NS 1000000000 /* until then it is not ready for a state and waits for none */
#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

struct worker {
    sem_t go;
    int end;
    fd_set in, out;
};

static struct worker workers[WORKERS];
static __thread struct worker *worker;
static int worker_count, state_socket = -1, is_answer_due;
static sem_t parked;
static int64_t now_ns, allowed_ns = STARTED_NS;
static float motors[4];

__attribute__((constructor)) static void begin(void)
{
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    sem_init(&parked, 0, 0);
    for (int k = 0; k < WORKERS; k++)
        sem_init(&workers[k].go, 0, 0);
}

static struct sockaddr_un path_of(int port)
{
    struct sockaddr_un path = {.sun_family = AF_UNIX};
    snprintf(path.sun_path, sizeof path.sun_path, "%d", port);
    return path;
}

static int port_of(const struct sockaddr *address)
{
    return ntohs(((const struct sockaddr_in *)address)->sin_port); /* in6 has it there, too */
}

static int wait_for_files(struct worker *w, struct timeval *patience)
{
    fd_set in = w->in, out = w->out;
    return REAL(select)(w->end, &in, &out, NULL, patience);
}

static void give_turn(struct worker *w)
{
    sem_post(&w->go);
    sem_wait(&parked);
}

static void take_all(void)
{
    for (int again = 1; again;) {
        again = 0;
        for (int k = 0; k < worker_count; k++)
            if (wait_for_files(&workers[k], &(struct timeval){0, 0}) > 0) {
                give_turn(&workers[k]);
                again = 1;
            }
    }
}

static void wait_for_state(void)
{
    for (int k = 0; k < worker_count; k++)
        give_turn(&workers[k]); /* what it waits for was chosen before it had this to send */
    take_all();
    while (now_ns >= allowed_ns) {
        if (is_answer_due) {
            struct sockaddr_un path = path_of(MOTORS_PORT);
            REAL(sendto)(state_socket, motors, sizeof motors, 0, (void *)&path, sizeof path);
            is_answer_due = 0;
        }
        struct worker all = {.end = 0};
        for (int k = 0; k < worker_count; k++)
            for (int file = 0; file < workers[k].end; file++)
                if (FD_ISSET(file, &workers[k].in)) {
                    FD_SET(file, &all.in);
                    all.end = file >= all.end ? file + 1 : all.end;
                }
        wait_for_files(&all, NULL);
        take_all();
    }
}

int nanosleep(const struct timespec *length, struct timespec *left)
{
    (void)left;
    now_ns += length->tv_sec * 1000000000LL + length->tv_nsec;
    if (now_ns >= allowed_ns)
        wait_for_state();
    return 0;
}

int clock_gettime(clockid_t clock, struct timespec *time)
{
    if (clock != CLOCK_MONOTONIC)
        return REAL(clock_gettime)(clock, time);
    if (!worker)
        now_ns += READING_NS;
    time->tv_sec = now_ns / 1000000000;
    time->tv_nsec = now_ns % 1000000000;
    return 0;
}

int select(int end, fd_set *in, fd_set *out, fd_set *failed, struct timeval *patience)
{
    (void)patience;
    if (!worker)
        worker = &workers[worker_count++];
    worker->end = end;
    if (in)
        worker->in = *in;
    if (out)
        worker->out = *out;
    sem_post(&parked);
    sem_wait(&worker->go);
    return REAL(select)(end, in, out, failed, &(struct timeval){0, 0});
}

int pthread_create(pthread_t *thread, const pthread_attr_t *with, void *(*run)(void *), void *data)
{
    int failure = REAL(pthread_create)(thread, with, run, data);
    if (!failure)
        sem_wait(&parked);
    return failure;
}

int pthread_join(pthread_t thread, void **result)
{
    (void)thread, (void)result;
    _exit(0); /* a restart of the board: its settings are written by now */
}

int socket(int domain, int type, int protocol)
{
    if (domain != AF_INET && domain != AF_INET6)
        return REAL(socket)(domain, type, protocol);
    return REAL(socket)(AF_UNIX, type, 0);
}

int bind(int file, const struct sockaddr *address, socklen_t size)
{
    (void)size;
    struct sockaddr_un path = path_of(port_of(address));
    if (port_of(address) == STATE_PORT)
        state_socket = file;
    unlink(path.sun_path);
    return REAL(bind)(file, (void *)&path, sizeof path);
}

ssize_t sendto(int file, const void *data, size_t size, int flags, const struct sockaddr *address,
               socklen_t address_size)
{
    (void)file, (void)flags, (void)address_size;
    if (port_of(address) == MOTORS_PORT && size == sizeof motors)
        memcpy(motors, data, size);
    return (ssize_t)size;
}

ssize_t recvfrom(int file, void *data, size_t size, int flags, struct sockaddr *address,
                 socklen_t *address_size)
{
    (void)address, (void)address_size;
    ssize_t got = REAL(recv)(file, data, size, flags);
    if (file == state_socket && got >= (ssize_t)sizeof(double)) {
        double until;
        memcpy(&until, data, sizeof until);
        allowed_ns = (int64_t)(until * 1e9);
        memset(data, 0, sizeof until); /* or it would measure the pace of time by it */
        is_answer_due = 1;
    }
    return got;
}
