// Requests at a role's metrics page: any bytes get one answer, whose length is the one it names.

#include <string>

#include "base/check.h"
#include "metrics/http_server.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  const fuzz::Input input(data, size);
  const std::string answer = metrics::AnswerHttp(
      input.text(), metrics::HostRule::kLocal, [](std::string_view path) -> metrics::HttpAnswer {
        SLALOM_CHECK(path.find('?') == std::string_view::npos);
        if (path != "/metrics") return {404, "Not Found", "text/plain; charset=utf-8", "none\n"};
        return {.body = "slalom_up 1\n"};
      });
  const std::size_t head = answer.find("\r\n\r\n");
  SLALOM_CHECK(answer.starts_with("HTTP/1.1 ") && head != std::string::npos);
  const std::size_t length = answer.find("Content-Length: ");
  SLALOM_CHECK(length < head);
  const std::size_t body = answer.size() - head - 4;
  SLALOM_CHECK(input.text().starts_with("HEAD ") ? body == 0
                                                 : std::stoul(answer.substr(length + 16)) == body);
  return 0;
}
