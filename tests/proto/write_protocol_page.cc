// Writes the tables of docs/protocol.md from proto/: write_protocol_page FILE.

#include <cstdio>

#include "base/file.h"
#include "tests/proto/protocol_page.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: write_protocol_page docs/protocol.md\n");
    return 2;
  }
  slalom::base::WriteFileAtomically(argv[1],
                                    slalom::proto::WithTables(slalom::base::ReadFile(argv[1])));
  return 0;
}
