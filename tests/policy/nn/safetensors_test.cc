#include "policy/nn/safetensors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "base/error.h"
#include "base/file.h"

namespace slalom::nn {
namespace {

class SafetensorsTest : public testing::Test {
 protected:
  SafetensorsTest() {
    std::filesystem::create_directories(directory_);
    const std::vector<float> floats = {1.0f, -2.5f, 3.0f, 4.0f, 5.0f, 6.0f};
    const std::vector<std::int64_t> counters = {1, -1};
    tensors_["weights"] = StoredTensor::Of(std::span<const float>(floats), {2, 3});
    tensors_["counters"] = StoredTensor::Of(std::span<const std::int64_t>(counters));
    SaveTensors(path_, tensors_, {{"seed", "13"}, {"text", "line\nwith \"quotes\""}});
  }
  ~SafetensorsTest() override { std::filesystem::remove_all(directory_); }

  std::string Refusal() const {
    try {
      LoadTensors(path_);
    } catch (const base::Error& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr(path_.string()));
      return error.what();
    }
    return "";
  }
  void Overwrite(const std::string& content) {
    std::ofstream(path_, std::ios::binary | std::ios::trunc) << content;
  }

  const std::filesystem::path directory_ =
      std::filesystem::path(testing::TempDir()) /
      ("safetensors_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
  const std::filesystem::path path_ = directory_ / "file.safetensors";
  TensorMap tensors_;
};

TEST_F(SafetensorsTest, RoundTrips) {
  const TensorFile file = LoadTensors(path_);
  EXPECT_EQ(file.tensors, tensors_);
  EXPECT_EQ(file.metadata, (Metadata{{"seed", "13"}, {"text", "line\nwith \"quotes\""}}));
  std::vector<std::int64_t> counters(2);
  file.Read("counters", std::span(counters));
  EXPECT_THAT(counters, testing::ElementsAre(1, -1));
}

TEST_F(SafetensorsTest, RefusesMissingOrDifferentTensors) {
  const TensorFile file = LoadTensors(path_);
  std::vector<float> values(6);
  EXPECT_THROW(file.Read("absent", std::span(values)), base::Error);
  EXPECT_THROW(file.Read("weights", std::span(values).first(5)), base::Error);
  EXPECT_THROW(file.Read("counters", std::span(values).first(4)), base::Error);
}

TEST_F(SafetensorsTest, NoticesEveryTruncation) {
  const std::string whole = base::ReadFile(path_);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    Overwrite(whole.substr(0, size));
    EXPECT_NE(Refusal(), "") << "cut to " << size << " bytes";
  }
}

TEST_F(SafetensorsTest, NoticesEveryChangedByteOfTheTensors) {
  const std::string whole = base::ReadFile(path_);
  std::uint64_t length;
  std::memcpy(&length, whole.data(), sizeof(length));
  for (std::size_t i = 8 + length; i < whole.size(); ++i) {
    std::string damaged = whole;
    damaged[i] ^= 0x10;
    Overwrite(damaged);
    EXPECT_THAT(Refusal(), testing::HasSubstr("checksum")) << "byte " << i;
  }
}

TEST_F(SafetensorsTest, SurvivesEveryChangedByteOfTheHeader) {
  const std::string whole = base::ReadFile(path_);
  std::uint64_t length;
  std::memcpy(&length, whole.data(), sizeof(length));
  for (std::size_t i = 0; i < 8 + length; ++i) {
    for (const int flip : {0x01, 0x10, 0x80}) {
      std::string damaged = whole;
      damaged[i] = static_cast<char>(damaged[i] ^ flip);
      Overwrite(damaged);
      Refusal();  // It may be a legal file with another name in it; it must not crash.
    }
  }
}

// However many tensors claim the same bytes, they are not copied for each.
TEST_F(SafetensorsTest, RefusesTensorsThatShareTheirBytes) {
  std::string header = "{";
  for (int i = 0; i < 10000; ++i) {
    header += "\"" + std::to_string(i) +
              "\":{\"dtype\":\"U8\",\"shape\":[1000000],\"data_offsets\":[0,1000000]},";
  }
  header.back() = '}';
  const std::uint64_t length = header.size();
  std::string content(reinterpret_cast<const char*>(&length), sizeof(length));
  Overwrite(content + header + std::string(1000000, 'x'));
  EXPECT_THAT(Refusal(), testing::HasSubstr("claims bytes 0 to 1000000"));
}

TEST_F(SafetensorsTest, RefusesOffsetsAndShapesThatAreNoWholeNumbers) {
  for (const std::string description :
       {R"("shape":[1],"data_offsets":[0,4e74])", R"("shape":[1],"data_offsets":[0.5,4])",
        R"("shape":[1.5],"data_offsets":[0,4])", R"("shape":[-1],"data_offsets":[0,4])"}) {
    const std::string header = R"({"a":{"dtype":"F32",)" + description + "}}";
    const std::uint64_t length = header.size();
    const std::string content(reinterpret_cast<const char*>(&length), sizeof(length));
    Overwrite(content + header + "1234");
    EXPECT_THAT(Refusal(), testing::HasSubstr("whole number")) << description;
  }
}

TEST_F(SafetensorsTest, RefusesWhatIsNoSuchFile) {
  Overwrite("not a tensor file at all, but long enough");
  EXPECT_THAT(Refusal(), testing::HasSubstr("is no safetensors file"));
  std::filesystem::remove(path_);
  EXPECT_NE(Refusal(), "");
}

}  // namespace
}  // namespace slalom::nn
