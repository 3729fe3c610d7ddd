#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <fnmatch.h>
#include <poll.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>

/// Stands in for functions of the C library, so that tests can make them fail and watch them. A
/// test is linked with this file, or a program loads it as a library (LD_PRELOAD). `FailingCalls`
/// says what fails, `PowerLoss` watches.

namespace {

using Observer = void (*)(const char* function, int fd, const char* path);

std::atomic<const char*> rule_here{nullptr};
std::atomic<long> calls_here{0};
std::atomic<Observer> observer{nullptr};

/// The rule of a program that was started with one, or with the name of a file that may hold one.
const char* RuleOfProgram() {
  static const char* const rule = getenv("SLALOM_FAILING_CALL");
  static const char* const file = getenv("SLALOM_FAILING_CALL_FILE");
  if (rule != nullptr || file == nullptr) return rule;
  thread_local char text[1200];
  const int before = errno;
  const int fd = static_cast<int>(syscall(SYS_openat, AT_FDCWD, file, O_RDONLY | O_CLOEXEC));
  const long size = fd < 0 ? 0 : syscall(SYS_read, fd, text, sizeof(text) - 1);
  if (fd >= 0) syscall(SYS_close, fd);
  errno = before;
  if (size <= 0) return nullptr;
  text[size] = '\0';
  return text;
}

const char* Rule() {
  const char* const here = rule_here.load();
  return here != nullptr ? here : RuleOfProgram();
}

enum class Fate { kWorks, kFails, kIsShort };

/// Counts a call if its path is one that counts. Sets errno if the call is to fail.
Fate FateOf(const char* function, const char* path) {
  const char* const rule = Rule();
  if (rule == nullptr || path == nullptr) return Fate::kWorks;
  char name[16];
  char pattern[512];
  char count[512];
  int error = 0;
  long first = 0;
  long last = 0;
  const int num_read =
      sscanf(rule, "%15s %511s %d %ld %ld %511s", name, pattern, &error, &first, &last, count);
  if (num_read != 6) abort();
  if (fnmatch(name, function, 0) != 0 || fnmatch(pattern, path, 0) != 0) return Fate::kWorks;
  const int before = errno;
  long calls = 0;
  if (rule_here.load() != nullptr) {
    calls = ++calls_here;
  } else {
    const int fd = static_cast<int>(
        syscall(SYS_openat, AT_FDCWD, count, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644));
    if (syscall(SYS_write, fd, "x", 1) != 1) abort();
    // Where this call's own byte ends, whoever else appends.
    calls = static_cast<long>(lseek(fd, 0, SEEK_CUR));
    syscall(SYS_close, fd);
  }
  errno = before;
  if (calls < first || last < calls) return Fate::kWorks;
  if (error == 0) return Fate::kIsShort;
  if (error < 0) {  // A slow disk.
    poll(nullptr, 0, -error);
    return Fate::kWorks;
  }
  errno = error;
  return Fate::kFails;
}

Fate FateOf(const char* function, int fd) {
  if (Rule() == nullptr) return Fate::kWorks;
  char link[32];
  char path[512];
  snprintf(link, sizeof(link), "/proc/self/fd/%d", fd);
  const ssize_t size = readlink(link, path, sizeof(path) - 1);
  if (size < 0) return Fate::kWorks;
  path[size] = '\0';
  return FateOf(function, path);
}

template <class Place>
bool Fails(const char* function, Place place) {
  return FateOf(function, place) == Fate::kFails;
}

/// Tells who watches of a call that is about to be made, or that a file or directory was made.
void Tell(const char* function, int fd, const char* path) {
  if (const Observer observe = observer.load(); observe != nullptr) {
    const int before = errno;
    observe(function, fd, path);
    errno = before;
  }
}

/// Whether somebody watches, and there is nothing of this path yet.
bool IsNew(const char* path) {
  if (observer.load() == nullptr) return false;
  const int before = errno;
  const bool is_new = syscall(SYS_faccessat, AT_FDCWD, path, F_OK) != 0;
  errno = before;
  return is_new;
}

/// Whether a test says what fails or watches. It then needs no disk, whose syncs take long.
bool IsTried() { return Rule() != nullptr || observer.load() != nullptr; }

/// The part of `size` bytes that a short transfer moves.
size_t Part(Fate fate, size_t size) { return fate == Fate::kIsShort ? (size + 1) / 2 : size; }

/// The C library's own.
template <class Function>
Function* Real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

/// Number of calls that the last rule of this program alone has counted.
long slalom_num_failing_calls() { return calls_here; }

/// A rule of this program alone. It stays readable after its end, for a call of another thread that
/// has begun before.
void slalom_set_failing_call(const char* rule) {
  static char rules[16][1200];
  static unsigned next = 0;
  if (rule == nullptr) {
    rule_here = nullptr;
    return;
  }
  char* const copy = rules[next++ % 16];
  strncpy(copy, rule, sizeof(rules[0]) - 1);
  calls_here = 0;
  rule_here = copy;
}

void slalom_set_call_observer(Observer observe) { observer = observe; }

int open(const char* path, int flags, ...) {
  va_list more;
  va_start(more, flags);
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(more, mode_t) : 0;
  va_end(more);
  static auto* const real = Real<int(const char*, int, ...)>("open");
  if (Fails("open", path)) return -1;
  const bool is_new = (flags & O_CREAT) != 0 && IsNew(path);
  if (is_new) Tell("open", -1, path);
  const int fd = real(path, flags, mode);
  if (is_new && fd >= 0) Tell("made", fd, nullptr);
  return fd;
}

int openat(int directory, const char* path, int flags, ...) {
  va_list more;
  va_start(more, flags);
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(more, mode_t) : 0;
  va_end(more);
  static auto* const real = Real<int(int, const char*, int, ...)>("openat");
  return Fails("openat", path) ? -1 : real(directory, path, flags, mode);
}

FILE* fopen64(const char* path, const char* mode) {
  static auto* const real = Real<FILE*(const char*, const char*)>("fopen64");
  if (Fails("fopen", path)) return nullptr;
  const bool is_new = mode[0] != 'r' && IsNew(path);
  if (is_new) Tell("open", -1, path);
  FILE* const file = real(path, mode);
  if (is_new && file != nullptr) Tell("made", fileno(file), nullptr);
  return file;
}
FILE* fopen(const char* path, const char* mode) { return fopen64(path, mode); }

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
  Tell("link", -1, to);
  const int result = real(from, to);
  if (!fails) return result;
  errno = error;
  return -1;
}

int rename(const char* from, const char* to) {
  static auto* const real = Real<int(const char*, const char*)>("rename");
  if (Fails("rename", to)) return -1;
  Tell("rename", -1, to);
  return real(from, to);
}

int unlink(const char* path) {
  static auto* const real = Real<int(const char*)>("unlink");
  if (Fails("unlink", path)) return -1;
  Tell("unlink", -1, path);
  return real(path);
}

int unlinkat(int directory, const char* path, int flags) {
  static auto* const real = Real<int(int, const char*, int)>("unlinkat");
  if (Fails("unlinkat", path)) return -1;
  Tell("unlink", directory, path);
  return real(directory, path, flags);
}

int remove(const char* path) {
  static auto* const real = Real<int(const char*)>("remove");
  if (Fails("remove", path)) return -1;
  Tell("unlink", -1, path);
  return real(path);
}

int mkdir(const char* path, mode_t mode) {
  static auto* const real = Real<int(const char*, mode_t)>("mkdir");
  if (Fails("mkdir", path)) return -1;
  const bool is_new = IsNew(path);
  if (is_new) Tell("mkdir", -1, path);
  const int result = real(path, mode);
  if (is_new && result == 0) Tell("made", -1, path);
  return result;
}

int truncate(const char* path, off_t size) {
  static auto* const real = Real<int(const char*, off_t)>("truncate");
  return Fails("truncate", path) ? -1 : real(path, size);
}

int ftruncate(int fd, off_t size) {
  static auto* const real = Real<int(int, off_t)>("ftruncate");
  return Fails("ftruncate", fd) ? -1 : real(fd, size);
}

int stat(const char* path, struct stat* status) {
  static auto* const real = Real<int(const char*, struct stat*)>("stat");
  return Fails("stat", path) ? -1 : real(path, status);
}

int lstat(const char* path, struct stat* status) {
  static auto* const real = Real<int(const char*, struct stat*)>("lstat");
  return Fails("lstat", path) ? -1 : real(path, status);
}

int fstat(int fd, struct stat* status) {
  static auto* const real = Real<int(int, struct stat*)>("fstat");
  return Fails("fstat", fd) ? -1 : real(fd, status);
}

ssize_t read(int fd, void* bytes, size_t size) {
  static auto* const real = Real<ssize_t(int, void*, size_t)>("read");
  const Fate fate = FateOf("read", fd);
  return fate == Fate::kFails ? -1 : real(fd, bytes, Part(fate, size));
}

ssize_t write(int fd, const void* bytes, size_t size) {
  static auto* const real = Real<ssize_t(int, const void*, size_t)>("write");
  const Fate fate = FateOf("write", fd);
  return fate == Fate::kFails ? -1 : real(fd, bytes, Part(fate, size));
}

/// A short one writes a part of the first buffer.
ssize_t pwritev(int fd, const iovec* buffers, int count, off_t offset) {
  static auto* const real = Real<ssize_t(int, const iovec*, int, off_t)>("pwritev");
  const Fate fate = FateOf("pwritev", fd);
  if (fate == Fate::kFails) return -1;
  if (fate == Fate::kWorks || count == 0) return real(fd, buffers, count, offset);
  const iovec part{buffers[0].iov_base, Part(fate, buffers[0].iov_len)};
  return real(fd, &part, 1, offset);
}

int fsync(int fd) {
  static auto* const real = Real<int(int)>("fsync");
  if (Fails("fsync", fd)) return -1;
  Tell("fsync", fd, nullptr);
  return IsTried() ? 0 : real(fd);
}

int fdatasync(int fd) {
  static auto* const real = Real<int(int)>("fdatasync");
  if (Fails("fdatasync", fd)) return -1;
  Tell("fdatasync", fd, nullptr);
  return IsTried() ? 0 : real(fd);
}

/// Its path is "thread". It returns its error.
int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*body)(void*),
                   void* argument) {
  using Create = int(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*);
  static auto* const real = Real<Create>("pthread_create");
  return Fails("pthread_create", "thread") ? errno : real(thread, attributes, body, argument);
}

void* mmap(void* address, size_t size, int protection, int flags, int fd, off_t offset) {
  static auto* const real = Real<void*(void*, size_t, int, int, int, off_t)>("mmap");
  return fd >= 0 && Fails("mmap", fd) ? MAP_FAILED
                                      : real(address, size, protection, flags, fd, offset);
}

}  // extern "C"
