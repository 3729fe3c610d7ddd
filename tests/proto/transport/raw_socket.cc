#include "tests/proto/transport/raw_socket.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "base/check.h"

namespace slalom::transport::test {
namespace {

constexpr std::size_t kGreetingBytes = 64;

sockaddr_in AddressOf(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  return address;
}

int NewSocket() {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  SLALOM_CHECK_GE(fd, 0);
  return fd;
}

}  // namespace

RawSocket::RawSocket(const std::string& endpoint) : fd_(NewSocket()) {
  const sockaddr_in address = AddressOf(std::stoi(endpoint.substr(endpoint.rfind(':') + 1)));
  SLALOM_CHECK_EQ(connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
}

RawSocket::~RawSocket() {
  if (fd_ >= 0) close(fd_);
}

bool RawSocket::Write(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (n < 0 && (errno == EPIPE || errno == ECONNRESET)) return false;
    if (n < 0) throw std::runtime_error(fmt::format("send: {}", std::strerror(errno)));
    bytes.remove_prefix(static_cast<std::size_t>(n));
  }
  return true;
}

void RawSocket::ReadToEnd() {
  std::array<char, 4096> buffer;
  for (;;) {
    const ssize_t n = recv(fd_, buffer.data(), buffer.size(), 0);
    if (n == 0 || (n < 0 && errno == ECONNRESET)) return;
    if (n < 0) throw std::runtime_error(fmt::format("recv: {}", std::strerror(errno)));
  }
}

std::string RawSocket::ReadExactly(std::size_t num_bytes) {
  std::string bytes(num_bytes, '\0');
  for (std::size_t done = 0; done < num_bytes;) {
    const ssize_t n = recv(fd_, bytes.data() + done, num_bytes - done, 0);
    if (n <= 0) throw std::runtime_error(fmt::format("recv: {}", std::strerror(errno)));
    done += static_cast<std::size_t>(n);
  }
  return bytes;
}

void RawSocket::ShakeHands() {
  std::string greeting(kGreetingBytes, '\0');
  greeting[0] = '\xff';
  greeting[9] = '\x7f';
  greeting[10] = 3;  // ZMTP 3.0
  greeting.replace(12, 4, "NULL");
  Write(greeting);
  ReadExactly(kGreetingBytes);
  const std::string property = std::string("\x0bSocket-Type\0\0\0\x06", 16) + "DEALER";
  const std::string body = "\x05READY" + property;
  Write(std::string("\x04", 1) + static_cast<char>(body.size()) + body);
  const std::string flags_and_size = ReadExactly(2);
  ReadExactly(static_cast<unsigned char>(flags_and_size[1]));
}

RawListener::RawListener() : fd_(NewSocket()) {
  sockaddr_in address = AddressOf(0);
  socklen_t size = sizeof address;
  SLALOM_CHECK_EQ(bind(fd_, reinterpret_cast<const sockaddr*>(&address), size), 0);
  SLALOM_CHECK_EQ(listen(fd_, 8), 0);
  SLALOM_CHECK_EQ(getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size), 0);
  endpoint_ = fmt::format("tcp://127.0.0.1:{}", ntohs(address.sin_port));
}

RawListener::~RawListener() { close(fd_); }

RawSocket RawListener::Accept() {
  const int fd = accept(fd_, nullptr, nullptr);
  if (fd < 0) throw std::runtime_error(fmt::format("accept: {}", std::strerror(errno)));
  return RawSocket(fd);
}

}  // namespace slalom::transport::test
