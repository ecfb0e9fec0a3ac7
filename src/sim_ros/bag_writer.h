// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/message_traits.h>
#include <rosbag/bag.h>
#include <rosbag/exceptions.h>
#include <boost/make_shared.hpp>

#include <exception>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>

namespace view_servo
{
/**
 * Writes a bag. Until finish() it has another name beside its own, and it is deleted when that is not called: a file of
 * the bag's name is always complete. All failures are thrown as std::runtime_error that names the file.
 */
class BagWriter
{
public:
  explicit BagWriter(const std::string& file) : file_(file), partial_(file + ".partial")
  {
    if (std::filesystem::is_directory(file_))
    {
      throw std::runtime_error("cannot write '" + file_ + "': it is a folder");
    }
    explained([this] { bag_->open(partial_, rosbag::bagmode::Write); });
    bag_->setCompression(rosbag::compression::BZ2);
  }

  ~BagWriter()
  {
    try
    {
      bag_->close();
    }
    catch (const rosbag::BagException&)
    {
      // Its destructor would try once more, and end the program. It is kept, for leak checkers as well.
      static const rosbag::Bag* abandoned = nullptr;
      abandoned = bag_.release();
      static_cast<void>(abandoned);
    }
    std::error_code ignored;
    std::filesystem::remove(partial_, ignored);
  }
  BagWriter(const BagWriter&) = delete;
  BagWriter& operator=(const BagWriter&) = delete;

  /** @param stamp when the message is recorded. */
  template <typename Message>
  void write(const std::string& topic, const ros::Time& stamp, const Message& message)
  {
    explained([&] { bag_->write(topic, stamp, message); });
  }

  /** Writes a message of a latched topic: when the bag is played, late subscribers get it, too. */
  template <typename Message>
  void writeLatched(const std::string& topic, const ros::Time& stamp, const Message& message)
  {
    const auto header = boost::make_shared<ros::M_string>();
    (*header)["topic"] = topic;
    (*header)["type"] = ros::message_traits::datatype(message);
    (*header)["md5sum"] = ros::message_traits::md5sum(message);
    (*header)["message_definition"] = ros::message_traits::definition(message);
    (*header)["latching"] = "1";
    explained([&] { bag_->write(topic, stamp, message, header); });
  }

  /** Closes the bag and gives it its name. */
  void finish()
  {
    explained([this] {
      bag_->close();
      std::filesystem::rename(partial_, file_);
    });
  }

private:
  /** Does something with the bag; when that throws, the file is named. */
  template <typename Action>
  void explained(const Action& action)
  {
    try
    {
      action();
    }
    catch (const std::exception& error)
    {
      throw std::runtime_error("cannot write '" + file_ + "': " + error.what());
    }
  }

  std::string file_;
  std::string partial_;
  std::unique_ptr<rosbag::Bag> bag_ = std::make_unique<rosbag::Bag>();
};

}  // namespace view_servo
