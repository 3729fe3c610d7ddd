// The list of who may connect.

#include <fstream>

#include "base/error.h"
#include "proto/transport/keys.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  static const std::filesystem::path directory = fuzz::ScratchDirectory("allowed");
  std::ofstream(directory / "allowed", std::ios::binary) << fuzz::Input(data, size).text();
  try {
    for (const auto& [key, allowed] : transport::LoadAllowList(directory)) {
      const std::string_view role = transport::ToString(allowed.role);
      fuzz::Require(key.size() == 40 && transport::ParseRole(role) == allowed.role);
      fuzz::Require(allowed.names.find_first_of("\t\r\n") == std::string::npos);
    }
  } catch (const base::Error&) {
  }
  return 0;
}
