// The bytes of each message, so that a change of the wire format is seen. A line that has to change
// means a new major version, but for fields that were added to an example.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <map>

#include "tests/proto/examples.h"

namespace slalom::proto {
namespace {

std::string Hex(std::string_view bytes) {
  std::string text;
  for (const char c : bytes) text += fmt::format("{:02x}", static_cast<unsigned char>(c));
  return text;
}

/// By name: the prefix, then the protobuf.
const std::map<std::string_view, std::string>& GoldenFrames() {
  static const std::map<std::string_view, std::string> frames = {
      {"Hello",
       "534c4c4d01000100a6bf6207b449a5860a056163746f7212076163746f722d33180720f0bdf3d589cf959a1228d"
       "00530103a0c736c616c6f6d20302e312e30"},
      {"Welcome",
       "534c4c4d0100020067ef1663bf5d33890890e4d0b287d3aeeefe011007180b2080808004280630a08d063a0c736"
       "c616c6f6d20302e312e30"},
      {"Insert",
       "534c4c4d010003001fe07d2f727d1812080710ac02184020d005283c30ffffffffffffffffff01382a"},
      {"InsertAck", "534c4c4d0100040033cb8e60ce20ea9c080710ad021880808002"},
      {"Goodbye", "534c4c4d010005001388d30431f9136c0807"},
      {"SampleRequest",
       "534c4c4d0100060012da8db6358a771708e8071080021804200529ae47e17a14aeef3f3001399a9999999999d93"
       "f4002488827"},
      {"SampleReply",
       "534c4c4d010007008c752e780c9febd408e807108002180420d005280130959aef3a38c09a0c410000000000c04"
       "44049000000000080284050035811"},
      {"PriorityUpdate", "534c4c4d01000800bff12a3a41f7fed2088002"},
      {"SnapshotRequest",
       "534c4c4d010009006231f97f480ba36208ffffffffffffffffff0112096576616c7561746f72"},
      {"Snapshot",
       "534c4c4d01000a0001efcd37216f3e51082b10f0bdf3d589cf959a1218959a97ece39fe7cb1720c0deeb3a"},
      {"Report",
       "534c4c4d01000b0056e529a09d3250c00a056163746f7212076163746f722d331a140a09626c6f636b65645f731"
       "100000000000000001a0e0a036c616711000000000000f0bf1a100a0573746570731100000000004a934022170a"
       "07636f7572736573120c7374617469632d747261696e220e0a04686f737412066e6f64652037"},
      {"StatusRequest", "534c4c4d01000c00842d963282de6105"},
      {"StatusReply",
       "534c4c4d01000d0060692ec681da1fef0a7e0a710a056163746f7212076163746f722d331a140a09626c6f636b6"
       "5645f731100000000000000001a0e0a036c616711000000000000f0bf1a100a0573746570731100000000004a93"
       "4022170a07636f7572736573120c7374617469632d747261696e220e0a04686f737412066e6f646520371100000"
       "0000000e83f18010a170a0c0a076c6561726e657212016c1100000000000008401002"},
      {"Refusal",
       "534c4c4d01000e008759bb069278b16a080712126578706563746564206368756e6b2033303118af02"},
  };
  return frames;
}

TEST(GoldenTest, FramesAreTheSameBytesAsEver) {
  ASSERT_EQ(Examples().size(), std::variant_size_v<Header>);
  for (const Example& example : Examples()) {
    const auto golden = GoldenFrames().find(NameOf(example.header));
    const std::string found = Hex(Encode(example.header, Bytes(example.payload)));
    EXPECT_EQ(found, golden == GoldenFrames().end() ? "" : golden->second)
        << "{\"" << NameOf(example.header) << "\",\n\"" << found << "\"},";
  }
}

}  // namespace
}  // namespace slalom::proto
