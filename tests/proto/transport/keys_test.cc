#include "proto/transport/keys.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <filesystem>
#include <set>
#include <string>

#include "base/file.h"
#include "tests/support/error_of.h"
#include "tests/support/scratch_directory.h"

namespace slalom::transport {
namespace {

using slalom::test::ErrorOf;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

unsigned ModeOf(const std::filesystem::path& path) {
  struct stat status {};
  EXPECT_EQ(stat(path.c_str(), &status), 0) << path;
  return status.st_mode & 0777;
}

class KeysTest : public ::testing::Test {
 protected:
  KeysTest() : directory_(scratch_.path() / "keys") { WriteNewKeys(directory_); }

  void Write(const std::string& name, const std::string& content) {
    base::WriteFileAtomically(directory_ / name, content);
    std::filesystem::permissions(directory_ / name, std::filesystem::perms::owner_read |
                                                        std::filesystem::perms::owner_write);
  }

  const test::ScratchDirectory scratch_;
  const std::filesystem::path directory_;
};

TEST(RoleTest, NamesAreReadAsTheyAreWritten) {
  for (const Role role : kRoles) EXPECT_EQ(ParseRole(ToString(role)), role);
  EXPECT_EQ(ParseRole("admin"), std::nullopt);
  EXPECT_EQ(ParseRole(""), std::nullopt);
  EXPECT_EQ(ParseRole("Actor"), std::nullopt);
}

TEST_F(KeysTest, NewKeysAreAllThereAllDifferentAndClosedToOthers) {
  const AllowList allowed = LoadAllowList(directory_);
  EXPECT_THAT(allowed, SizeIs(std::size(kRoles)));
  std::set<std::string> secrets;
  for (const Role role : kRoles) {
    const KeyPair keys = LoadKeyPair(directory_, role);
    secrets.insert(keys.secret_key);
    EXPECT_EQ(keys.public_key, LoadPublicKey(directory_, role));
    ASSERT_TRUE(allowed.contains(keys.public_key));
    EXPECT_EQ(allowed.at(keys.public_key), role);
    const std::string name(ToString(role));
    EXPECT_EQ(ModeOf(directory_ / (name + ".key")), 0600u);
    EXPECT_EQ(ModeOf(directory_ / (name + ".pub")), 0644u);
  }
  EXPECT_THAT(secrets, SizeIs(std::size(kRoles)));
  EXPECT_EQ(ModeOf(directory_), 0700u);
  EXPECT_THAT(CheckKeys(directory_).faults, IsEmpty());
  EXPECT_THAT(CheckKeys(directory_).found, SizeIs(std::size(kRoles) + 1));
}

TEST_F(KeysTest, KeysInUseAreNeverReplaced) {
  const std::string secret = base::ReadFile(directory_ / "actor.key");
  EXPECT_THAT(ErrorOf([&] { WriteNewKeys(directory_); }),
              AllOf(HasSubstr("replay.key"), HasSubstr("exists already")));
  EXPECT_EQ(base::ReadFile(directory_ / "actor.key"), secret);
  // Nor is anything written where only the last file is in the way.
  const auto other = scratch_.path() / "other";
  base::MakeDirectories(other);
  base::WriteFileAtomically(other / "allowed", "mine");
  EXPECT_THAT(ErrorOf([&] { WriteNewKeys(other); }), HasSubstr("allowed: exists already"));
  EXPECT_FALSE(std::filesystem::exists(other / "replay.key"));
}

TEST_F(KeysTest, ADirectoryThatCannotBeMadeIsNamed) {
  base::WriteFileAtomically(scratch_.path() / "file", "");
  EXPECT_THAT(ErrorOf([&] { WriteNewKeys(scratch_.path() / "file" / "keys"); }),
              HasSubstr("file/keys"));
}

TEST_F(KeysTest, ASecretThatOthersCanReadIsRefused) {
  using std::filesystem::perms;
  for (const perms more : {perms::group_read, perms::others_read, perms::others_write}) {
    std::filesystem::permissions(directory_ / "actor.key",
                                 perms::owner_read | perms::owner_write | more);
    EXPECT_THAT(
        ErrorOf([&] { LoadKeyPair(directory_, Role::kActor); }),
        AllOf(HasSubstr("actor.key"), HasSubstr("expected mode 0600"), HasSubstr("chmod 600")));
  }
  std::filesystem::permissions(directory_ / "actor.key", perms::owner_read);
  EXPECT_EQ(ErrorOf([&] { LoadKeyPair(directory_, Role::kActor); }), "");
}

TEST_F(KeysTest, OfSecretsThatAGroupReadsOnlyRootsArePrivate) {
  constexpr uid_t kRoot = 0, kUser = 10001;
  EXPECT_TRUE(IsPrivate(0600, kUser, kUser));
  EXPECT_TRUE(IsPrivate(0400, kRoot, kUser));
  EXPECT_TRUE(IsPrivate(0440, kRoot, kUser)) << "as Kubernetes has them";
  EXPECT_TRUE(IsPrivate(0640, kRoot, kUser));
  EXPECT_FALSE(IsPrivate(0440, kUser, kUser)) << "its own group may be everybody";
  EXPECT_FALSE(IsPrivate(0440, kRoot, kRoot));
  EXPECT_FALSE(IsPrivate(0460, kRoot, kUser));
  EXPECT_FALSE(IsPrivate(0444, kRoot, kUser));
  EXPECT_FALSE(IsPrivate(0404, kRoot, kUser));
}

TEST_F(KeysTest, WhatIsNoKeyIsRefusedAndNotPrinted) {
  const std::string secret = base::ReadFile(directory_ / "actor.key").substr(0, 40);
  for (const std::string& content :
       {std::string(), secret.substr(1), secret + "x", secret + "\n" + secret,
        "\"" + secret.substr(1), std::string(40, '#')}) {
    Write("actor.key", content);
    const std::string error = ErrorOf([&] { LoadKeyPair(directory_, Role::kActor); });
    EXPECT_THAT(error, AllOf(HasSubstr("actor.key"), HasSubstr("expected one line with one key")))
        << content;
    EXPECT_THAT(error, Not(HasSubstr(secret.substr(1, 30))));
  }
  Write("actor.pub", "nonsense");
  EXPECT_THAT(ErrorOf([&] { LoadPublicKey(directory_, Role::kActor); }), HasSubstr("actor.pub"));
  EXPECT_THAT(ErrorOf([&] { LoadPublicKey(scratch_.path(), Role::kActor); }),
              AllOf(HasSubstr("actor.pub"), HasSubstr("cannot open")));
}

TEST_F(KeysTest, SpacesAndLineEndsAroundAKeyDoNotMatter) {
  const KeyPair keys = LoadKeyPair(directory_, Role::kActor);
  Write("actor.key", "  " + keys.secret_key + "\r\n\n");
  EXPECT_EQ(LoadKeyPair(directory_, Role::kActor).secret_key, keys.secret_key);
  Write("actor.key", "\xef\xbb\xbf" + keys.secret_key);
  EXPECT_EQ(LoadKeyPair(directory_, Role::kActor).secret_key, keys.secret_key);
  Write("allowed",
        "\xef\xbb\xbf\n# ours\n  actor \t " + keys.public_key + "\r\n#\nactor " + keys.public_key);
  EXPECT_EQ(LoadAllowList(directory_), (AllowList{{keys.public_key, Role::kActor}}));
}

TEST_F(KeysTest, ALineOfTheListThatSaysNothingIsNamed) {
  const std::string key = NewKeyPair().public_key;
  const auto error_of = [&](const std::string& line) {
    Write("allowed", "# comment\nlearner " + NewKeyPair().public_key + "\n" + line + "\n");
    return ErrorOf([&] { LoadAllowList(directory_); });
  };
  EXPECT_THAT(error_of("admin " + key),
              AllOf(HasSubstr("allowed:3: 'admin' is not a role"), HasSubstr("operator")));
  EXPECT_THAT(error_of(key), HasSubstr("allowed:3:"));
  EXPECT_THAT(error_of("actor"), HasSubstr("allowed:3: '' is not a key"));
  EXPECT_THAT(error_of("actor " + key.substr(1)), HasSubstr("is not a key"));
  EXPECT_THAT(error_of("actor " + key + " a/b"), HasSubstr("allowed:3: 'a/b' names no process"));
  EXPECT_THAT(error_of("actor " + key + " a*b"), HasSubstr("'a*b' names no process"));
  EXPECT_THAT(error_of("actor " + key + " a\nactor " + key + " b"),
              HasSubstr("allowed:4: this key has the role actor already, with other names"));
  EXPECT_THAT(error_of("actor " + key + "\nlearner " + key),
              HasSubstr("allowed:4: this key has the role actor already"));
  Write("allowed", "# nobody\n");
  EXPECT_THAT(ErrorOf([&] { LoadAllowList(directory_); }), HasSubstr("allows nobody"));
}

TEST_F(KeysTest, AKeyMayBeBoundToNames) {
  const std::string key = NewKeyPair().public_key;
  Write("allowed", "actor " + key + " \t gpu-1  lab.*\r\n");
  const std::string names = LoadAllowList(directory_).at(key).names;
  EXPECT_EQ(names, "gpu-1 lab.*");
  for (const char* name : {"gpu-1", "lab.", "lab.7"}) EXPECT_TRUE(AllowsName(names, name)) << name;
  for (const char* name : {"", "gpu", "gpu-10", "lab", "other"}) {
    EXPECT_FALSE(AllowsName(names, name)) << name;
  }
  EXPECT_TRUE(AllowsName("", "any"));
  EXPECT_TRUE(AllowsName("*", "any"));
}

TEST_F(KeysTest, CheckFindsWhatDoesNotFitTogether) {
  const KeyPair actor = LoadKeyPair(directory_, Role::kActor);
  const KeyPair other = NewKeyPair();
  const auto faults = [&] { return CheckKeys(directory_).faults; };
  Write("actor.pub", other.public_key);
  EXPECT_THAT(faults(),
              ElementsAre(AllOf(HasSubstr("actor.pub: is not the public key of actor.key"),
                                HasSubstr(actor.public_key))));
  Write("actor.pub", actor.public_key);
  EXPECT_THAT(faults(), IsEmpty());

  const std::string allowed = base::ReadFile(directory_ / "allowed");
  const std::string line = "actor " + actor.public_key;
  std::string changed = allowed;
  changed.replace(changed.find(line), line.size(), "");
  Write("allowed", changed);
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("allowed: does not list the key of the role actor")));
  changed = allowed;
  changed.replace(changed.find(line), line.size(), "learner " + actor.public_key);
  Write("allowed", changed);
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("gives the key of actor the role learner")));
  Write("allowed", "nonsense");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("allowed:1: 'nonsense' is not a role")));
  Write("allowed", allowed);
  std::filesystem::permissions(directory_ / "learner.key", std::filesystem::perms::all);
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("learner.key")));
}

TEST_F(KeysTest, AMachineNeedsOnlyTheKeysOfItsRoles) {
  for (const char* name : {"allowed", "replay.key", "learner.key", "evaluator.key", "evaluator.pub",
                           "operator.key", "operator.pub"}) {
    std::filesystem::remove(directory_ / name);
  }
  const KeysReport report = CheckKeys(directory_);
  EXPECT_THAT(report.faults, IsEmpty());
  EXPECT_THAT(report.found, SizeIs(3));
  EXPECT_THAT(report.found, Contains(AllOf(HasSubstr("actor"), HasSubstr("secret and public"))));
  EXPECT_THAT(report.found, Contains(AllOf(HasSubstr("learner"), HasSubstr("public only"))));
}

TEST_F(KeysTest, CheckOfWhatIsNoDirectoryOfKeysSaysSo) {
  EXPECT_THAT(ErrorOf([&] { CheckKeys(directory_ / "none"); }), HasSubstr("is not a directory"));
  EXPECT_THAT(ErrorOf([&] { CheckKeys(directory_ / "allowed"); }), HasSubstr("is not a directory"));
  EXPECT_THAT(ErrorOf([&] { CheckKeys(scratch_.path()); }), HasSubstr("holds no keys"));
}

}  // namespace
}  // namespace slalom::transport
