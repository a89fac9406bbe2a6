/* Calls of the C library that can be made to fail: preloaded, and told through fail_next which call of which kind.

   Only calls on paths that contain a pattern, or on descriptors of such, are counted. A process that is started meanwhile
   takes its orders from FAILING_SYSTEM ("kind errno at pattern"). */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

enum { OPEN, READ, STAT, LIST, LOCK, MEMORY, KINDS };
#define DESCRIPTORS 4096
#define LARGE 32768 /* bytes; what is smaller belongs to Python and the loader */

static char pattern[4096];
static int kind = -1, number = 0;
static long at = -1, counted[KINDS], failed = 0;
static char ours[DESCRIPTORS];

extern void *__libc_malloc(size_t);
extern void *__libc_calloc(size_t, size_t);
extern void *__libc_realloc(void *, size_t);

/* From now on the call of this kind with this number fails with this errno; at -1: none does, all are counted. */
void fail_next(int which, int error, long when, const char *where) {
  kind = which, number = error, at = when, failed = 0;
  snprintf(pattern, sizeof pattern, "%s", where);
  memset(counted, 0, sizeof counted);
}

/* How many calls of this kind there were since fail_next. */
long calls(int which) { return counted[which]; }

/* How many of them failed. */
long failures(void) { return failed; }

__attribute__((constructor)) static void ordered(void) {
  const char *order = getenv("FAILING_SYSTEM");
  int which, error;
  long when;
  char where[4096];
  if (order && sscanf(order, "%d %d %ld %4095s", &which, &error, &when, where) == 4)
    fail_next(which, error, when, where);
}

static int fails(int which) {
  if (!pattern[0]) return 0;
  long mine = counted[which]++;
  if (which != kind || mine != at) return 0;
  failed++;
  errno = number;
  return 1;
}

static int meant(const char *path) { return pattern[0] && path && strstr(path, pattern) != NULL; }
static int is_ours(int fd) { return fd >= 0 && fd < DESCRIPTORS && ours[fd]; }
static int noted(int fd, int mark) {
  if (fd >= 0 && fd < DESCRIPTORS) ours[fd] = mark;
  return fd;
}

#define REAL(result, name, ...) ((result(*)(__VA_ARGS__))dlsym(RTLD_NEXT, name))
#define MODE                                  \
  mode_t mode = 0;                            \
  if (flags & (O_CREAT | O_TMPFILE)) {        \
    va_list rest;                             \
    va_start(rest, flags);                    \
    mode = va_arg(rest, mode_t);              \
    va_end(rest);                             \
  }
#define OPENS(name)                                                            \
  int name(const char *path, int flags, ...) {                                 \
    MODE;                                                                      \
    int mark = meant(path);                                                    \
    if (mark && fails(OPEN)) return -1;                                        \
    return noted(REAL(int, #name, const char *, int, mode_t)(path, flags, mode), mark); \
  }
OPENS(open)
OPENS(open64)
#define OPENS_AT(name)                                                         \
  int name(int folder, const char *path, int flags, ...) {                     \
    MODE;                                                                      \
    int mark = meant(path);                                                    \
    if (mark && fails(OPEN)) return -1;                                        \
    return noted(REAL(int, #name, int, const char *, int, mode_t)(folder, path, flags, mode), mark); \
  }
OPENS_AT(openat)
OPENS_AT(openat64)

int close(int fd) {
  noted(fd, 0);
  return REAL(int, "close", int)(fd);
}

#define READS(name, parameters, types, arguments)         \
  ssize_t name parameters {                               \
    if (is_ours(fd) && fails(READ)) return -1;            \
    return ((ssize_t(*) types)dlsym(RTLD_NEXT, #name)) arguments; \
  }
READS(read, (int fd, void *to, size_t size), (int, void *, size_t), (fd, to, size))
READS(pread, (int fd, void *to, size_t size, off_t from), (int, void *, size_t, off_t), (fd, to, size, from))
READS(pread64, (int fd, void *to, size_t size, off64_t from), (int, void *, size_t, off64_t), (fd, to, size, from))
READS(preadv, (int fd, const struct iovec *to, int n, off_t from), (int, const struct iovec *, int, off_t), (fd, to, n, from))
READS(preadv64, (int fd, const struct iovec *to, int n, off64_t from), (int, const struct iovec *, int, off64_t), (fd, to, n, from))
READS(preadv2, (int fd, const struct iovec *to, int n, off_t from, int f), (int, const struct iovec *, int, off_t, int), (fd, to, n, from, f))
READS(preadv64v2, (int fd, const struct iovec *to, int n, off64_t from, int f), (int, const struct iovec *, int, off64_t, int), (fd, to, n, from, f))

#define STATS(name, parameters, types, arguments, ours_) \
  int name parameters {                                  \
    if ((ours_) && fails(STAT)) return -1;               \
    return ((int(*) types)dlsym(RTLD_NEXT, #name)) arguments; \
  }
STATS(fstat, (int fd, struct stat *to), (int, struct stat *), (fd, to), is_ours(fd))
STATS(fstat64, (int fd, struct stat64 *to), (int, struct stat64 *), (fd, to), is_ours(fd))
STATS(stat, (const char *path, struct stat *to), (const char *, struct stat *), (path, to), meant(path))
STATS(stat64, (const char *path, struct stat64 *to), (const char *, struct stat64 *), (path, to), meant(path))
STATS(lstat, (const char *path, struct stat *to), (const char *, struct stat *), (path, to), meant(path))
STATS(lstat64, (const char *path, struct stat64 *to), (const char *, struct stat64 *), (path, to), meant(path))
STATS(fstatat, (int d, const char *path, struct stat *to, int f), (int, const char *, struct stat *, int), (d, path, to, f), meant(path))
STATS(fstatat64, (int d, const char *path, struct stat64 *to, int f), (int, const char *, struct stat64 *, int), (d, path, to, f), meant(path))
int flock(int fd, int how) {
  if (is_ours(fd) && fails(LOCK)) return -1;
  return REAL(int, "flock", int, int)(fd, how);
}

DIR *opendir(const char *path) {
  if (meant(path) && fails(LIST)) return NULL;
  return REAL(DIR *, "opendir", const char *)(path);
}

void *malloc(size_t size) {
  if (size >= LARGE && fails(MEMORY)) return NULL;
  return __libc_malloc(size);
}
void *calloc(size_t n, size_t size) {
  if (n * size >= LARGE && fails(MEMORY)) return NULL;
  return __libc_calloc(n, size);
}
void *realloc(void *old, size_t size) {
  if (size >= LARGE && fails(MEMORY)) return NULL;
  return __libc_realloc(old, size);
}
