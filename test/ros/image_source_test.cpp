// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/image_source.h"

#include "view_servo/images/image_io.h"

#include <gtest/gtest.h>

#include <string>

namespace view_servo
{
namespace
{
TEST(KindOf, TellsTheFieldThatIsSet)
{
  ImageSource source;
  EXPECT_EQ(kindOf(source, "query"), SourceKind::CAMERA);
  source.view = "desk";
  EXPECT_EQ(kindOf(source, "query"), SourceKind::VIEW);
  source = ImageSource();
  source.path = "desk.png";
  EXPECT_EQ(kindOf(source, "query"), SourceKind::PATH);
  source = ImageSource();
  source.image.width = 640;
  EXPECT_EQ(kindOf(source, "query"), SourceKind::IMAGE);
}

TEST(KindOf, NamesTheFieldsWhenSeveralAreSet)
{
  ImageSource source;
  source.view = "desk";
  source.path = "desk.png";
  try
  {
    kindOf(source, "query");
    FAIL() << "accepted two fields";
  }
  catch (const ImageError& error)
  {
    EXPECT_STREQ(error.what(), "query: only one of view, path and image may be set, not view and path");
  }
  source.image.data = { 1 };
  EXPECT_THROW(kindOf(source, "query"), ImageError);
}

}  // namespace
}  // namespace view_servo
