// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// What a store does with views whose files are not as it wrote them.
#include "view_store_test.h"

namespace view_servo
{
namespace test
{
namespace
{
namespace fs = std::filesystem;

class DamagedViewTest : public ViewStoreTest
{
protected:
  DamagedViewTest()
  {
    store_.save(plainView("good"), false);
    store_.save(fullView("bad"), false);
  }
};

TEST_F(DamagedViewTest, ChangedYamlIsReported)
{
  const std::string text = readText(file("bad.", ".yaml"));
  for (std::size_t i = 0; i < text.size(); i += 7)
  {
    std::string changed = text;
    changed[i] = static_cast<char>(changed[i] ^ 1);
    writeText(file("bad.", ".yaml"), changed);
    EXPECT_ERROR(store_.load("bad"), "checksum");
    EXPECT_ERROR(store_.revision("bad"), "checksum");
  }
  expectOnlyBadDamaged("checksum");
}

TEST_F(DamagedViewTest, TruncatedYamlIsReported)
{
  const std::string text = readText(file("bad.", ".yaml"));
  for (const std::size_t length : { std::size_t(0), std::size_t(1), text.size() / 2, text.size() - 1 })
  {
    writeText(file("bad.", ".yaml"), text.substr(0, length));
    expectOnlyBadDamaged("checksum");
  }
}

TEST_F(DamagedViewTest, SomethingElseInTheYamlIsReported)
{
  for (const std::string text : { "\x01\xFF\n", "[", "hello", "a: {", "checksum: cbf29ce484222325\n" })
  {
    writeText(file("bad.", ".yaml"), text);
    expectOnlyBadDamaged("");
  }
}

TEST_F(DamagedViewTest, TruncatedImageIsReported)
{
  const fs::path image = file("bad.", ".png");
  fs::resize_file(image, fs::file_size(image) - 10);
  expectOnlyBadDamaged("does not agree with the checksum");
}

TEST_F(DamagedViewTest, ChangedImageIsReported)
{
  EXPECT_EQ(store_.list().damaged.size(), 0U);  // now its image is known
  std::string bytes = readText(file("bad.", ".png"));
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 0x10);
  writeText(file("bad.", ".png"), bytes);
  expectOnlyBadDamaged("does not agree with the checksum");
}

TEST_F(DamagedViewTest, ImageOfAnotherViewIsReported)
{
  fs::copy_file(file("good.", ".png"), file("bad.", ".png"), fs::copy_options::overwrite_existing);
  expectOnlyBadDamaged("does not agree with the checksum");
}

/** A few bytes that decode to a gigabyte, with all checksums right: only the size in the header gives them away. */
TEST_F(DamagedViewTest, ImageWithABombsHeaderIsReported)
{
  using namespace std::string_literals;
  const fs::path image = file("bad.", ".png");
  const fs::path yaml = file("bad.", ".yaml");
  const std::string bytes = readText(image).replace(16, 8, "\0\0\x7D\0\0\0\x7D\0"s);
  const std::string old_name = image.filename().string();
  const std::string new_name = "bad." + fnv1a(bytes) + ".png";
  fs::remove(image);
  writeText(image.parent_path() / new_name, bytes);
  std::string text = readText(yaml);
  text.replace(text.find(old_name), old_name.size(), new_name);
  text.resize(text.find("checksum: "));
  writeText(yaml, text + "checksum: " + fnv1a(text) + "\n");
  expectOnlyBadDamaged("32000 x 32000 pixels");
}

TEST_F(DamagedViewTest, MissingImageIsReported)
{
  fs::remove(file("bad.", ".png"));
  expectOnlyBadDamaged("is missing");
}

TEST_F(DamagedViewTest, CanBeRemoved)
{
  writeText(file("bad.", ".yaml"), "nonsense");
  store_.remove("bad");
  EXPECT_TRUE(store_.list().damaged.empty());
  EXPECT_EQ(filesIn(store_.directory()).size(), 2U);
}

TEST_F(DamagedViewTest, CanBeOverwritten)
{
  fs::remove(file("bad.", ".png"));
  EXPECT_ERROR(store_.save(plainView("bad"), false), "there is one of that name");
  store_.save(plainView("bad"), true);
  expectSame(store_.load("bad"), plainView("bad"));
}

}  // namespace
}  // namespace test
}  // namespace view_servo
