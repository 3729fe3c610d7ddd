// Feeds every file of the directories named on the command line to a fuzzer's function, where there
// is no libFuzzer.

#include <cstdio>
#include <filesystem>
#include <string>

#include "base/file.h"
#include "tests/fuzz/fuzz_input.h"

int main(int argc, char** argv) {
  int count = 0;
  for (int i = 1; i < argc; ++i) {
    for (const auto& entry : std::filesystem::directory_iterator(argv[i])) {
      const std::string input = slalom::base::ReadFile(entry.path());
      std::printf("%s\n", entry.path().c_str());  // The last line names the input that crashed.
      std::fflush(stdout);
      LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(input.data()), input.size());
      ++count;
    }
  }
  std::printf("%d inputs\n", count);
  return count > 0 ? 0 : 1;
}
