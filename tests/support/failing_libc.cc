#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <fnmatch.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

/// Stands in for functions of the C library, so that tests can make them fail. A test is linked
/// with this file, or a program loads it as a library (LD_PRELOAD). `FailingCalls` says what fails.

namespace {

/// Counts a call if its path is one that counts. Sets errno if the call is to fail.
bool Fails(const char* function, const char* path) {
  const char* const rule = getenv("SLALOM_FAILING_CALL");
  if (rule == nullptr || path == nullptr) return false;
  char name[16];
  char pattern[512];
  char count[512];
  int error = 0;
  long first = 0;
  long last = 0;
  const int num_read =
      sscanf(rule, "%15s %511s %d %ld %ld %511s", name, pattern, &error, &first, &last, count);
  if (num_read != 6) abort();
  if (strcmp(name, function) != 0 || fnmatch(pattern, path, 0) != 0) {
    return false;
  }
  const int before = errno;
  const int fd = static_cast<int>(
      syscall(SYS_openat, AT_FDCWD, count, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644));
  if (syscall(SYS_write, fd, "x", 1) != 1) abort();
  // Where this call's own byte ends, whoever else appends.
  const long calls = static_cast<long>(lseek(fd, 0, SEEK_CUR));
  syscall(SYS_close, fd);
  const bool fails = first <= calls && calls <= last;
  errno = fails ? error : before;
  return fails;
}

bool Fails(const char* function, int fd) {
  if (getenv("SLALOM_FAILING_CALL") == nullptr) return false;
  char link[32];
  char path[512];
  snprintf(link, sizeof(link), "/proc/self/fd/%d", fd);
  const ssize_t size = readlink(link, path, sizeof(path) - 1);
  if (size < 0) return false;
  path[size] = '\0';
  return Fails(function, path);
}

/// The C library's own.
template <class Function>
Function* Real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
  va_list more;
  va_start(more, flags);
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(more, mode_t) : 0;
  va_end(more);
  static auto* const real = Real<int(const char*, int, ...)>("open");
  return Fails("open", path) ? -1 : real(path, flags, mode);
}

int openat(int directory, const char* path, int flags, ...) {
  va_list more;
  va_start(more, flags);
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(more, mode_t) : 0;
  va_end(more);
  static auto* const real = Real<int(int, const char*, int, ...)>("openat");
  return Fails("openat", path) ? -1 : real(directory, path, flags, mode);
}

dirent* readdir(DIR* directory) {
  static auto* const real = Real<dirent*(DIR*)>("readdir");
  return Fails("readdir", dirfd(directory)) ? nullptr : real(directory);
}

int posix_fallocate(int fd, off_t offset, off_t length) {
  static auto* const real = Real<int(int, off_t, off_t)>("posix_fallocate");
  return Fails("posix_fallocate", fd) ? errno : real(fd, offset, length);
}

/// Makes the link and fails, as NFS does if it repeats a call whose answer was lost.
int link(const char* from, const char* to) {
  static auto* const real = Real<int(const char*, const char*)>("link");
  const bool fails = Fails("link", to);
  const int error = errno;
  const int result = real(from, to);
  if (!fails) return result;
  errno = error;
  return -1;
}

int stat(const char* path, struct stat* status) {
  static auto* const real = Real<int(const char*, struct stat*)>("stat");
  return Fails("stat", path) ? -1 : real(path, status);
}

int lstat(const char* path, struct stat* status) {
  static auto* const real = Real<int(const char*, struct stat*)>("lstat");
  return Fails("lstat", path) ? -1 : real(path, status);
}

ssize_t write(int fd, const void* bytes, size_t size) {
  static auto* const real = Real<ssize_t(int, const void*, size_t)>("write");
  return Fails("write", fd) ? -1 : real(fd, bytes, size);
}

}  // extern "C"
