// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/serialization.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

/** @file
 * Messages of made-up bytes.
 */
namespace view_servo::fuzz
{
/**
 * Reads as roscpp does, but refuses an array that states more elements than bytes are left. roscpp makes room for as
 * many as the message states before it looks whether they have come.
 */
class MessageStream : public ros::serialization::Stream
{
public:
  static const ros::serialization::StreamType stream_type = ros::serialization::stream_types::Input;

  MessageStream(std::uint8_t* data, std::size_t size) : Stream(data, static_cast<std::uint32_t>(size))
  {
  }

  template <typename Value>
  void next(Value& value)
  {
    ros::serialization::deserialize(*this, value);
  }

  template <typename Value, typename Allocator>
  void next(std::vector<Value, Allocator>& values)
  {
    std::uint32_t count = 0;
    next(count);
    if (count > getLength())
    {
      ros::serialization::throwStreamOverrun();
    }
    values.resize(count);
    for (Value& value : values)
    {
      next(value);
    }
  }
};

/** The message of these bytes; empty when they end too early, as roscpp does not hand on such a message. */
template <typename Message>
std::optional<Message> received(const std::uint8_t* data, std::size_t size)
{
  if (size == 0)
  {
    return std::nullopt;  // roscpp steps over a null pointer then, which UndefinedBehaviorSanitizer sees
  }
  std::vector<std::uint8_t> bytes(data, data + size);
  Message message;
  try
  {
    MessageStream stream(bytes.data(), bytes.size());
    stream.next(message);
  }
  catch (const ros::serialization::StreamOverrunException&)
  {
    return std::nullopt;
  }
  return message;
}

/** A part of an input. */
struct Record
{
  std::uint8_t kind = 0;
  const std::uint8_t* data = nullptr;
  std::size_t size = 0;

  template <typename Message>
  std::optional<Message> as() const
  {
    return received<Message>(data, size);
  }
};

/** Cuts an input into records: a byte of the kind, two of the length (the low one first), and as many bytes. */
inline std::vector<Record> recordsOf(const std::uint8_t* data, std::size_t size)
{
  constexpr std::size_t HEAD = 3;
  std::vector<Record> records;
  for (std::size_t at = 0; at + HEAD <= size;)
  {
    const std::size_t stated = data[at + 1] + std::size_t{ 256 } * data[at + 2];
    const std::size_t length = std::min(stated, size - at - HEAD);
    records.push_back({ data[at], data + at + HEAD, length });
    at += HEAD + length;
  }
  return records;
}
}  // namespace view_servo::fuzz
