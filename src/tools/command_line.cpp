// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/command_line.h"

#include <boost/lexical_cast/try_lexical_convert.hpp>
#include <boost/program_options/errors.hpp>
#include <boost/program_options/parsers.hpp>
#include <boost/program_options/positional_options.hpp>
#include <boost/program_options/value_semantic.hpp>

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

namespace view_servo
{
namespace po = boost::program_options;

namespace
{
constexpr char WORDS[] = "words without a name";

std::string textOf(const NumberRange& range)
{
  std::ostringstream text;
  text.precision(12);
  if (std::isinf(range.high))
  {
    text << ">= " << range.low;
  }
  else
  {
    text << '[' << range.low << ", " << range.high << ']';
  }
  return text.str();
}

template <typename Number>
struct Held
{
  using Type = Number;
};
template <typename Number>
struct Held<std::optional<Number>>
{
  using Type = Number;
};

template <typename Number>
std::string withDefault(const std::string& description, const Number& value)
{
  std::ostringstream text;
  text << description << "; default: " << value;
  return text.str();
}
template <typename Number>
std::string withDefault(const std::string& description, const std::optional<Number>& /*value*/)
{
  return description;
}

}  // namespace

void requireWritten(std::ostream& standard_output)
{
  if (!standard_output.flush())
  {
    throw std::runtime_error("what is printed cannot be written to standard output: is the disk full?");
  }
}

CommandLine::CommandLine(std::string introduction, std::string ending)
  : introduction_(std::move(introduction)), ending_(std::move(ending))
{
  options_.add_options()("help", "Print this, and end");
}

template <typename Take>
void CommandLine::addWord(const std::string& name, const std::string& kind, const std::string& description,
                          const Take& take)
{
  options_.add_options()(name.c_str(), po::value<std::string>()->value_name(kind)->notifier(take), description.c_str());
}

template <typename Number>
void CommandLine::number(const std::string& name, Number& value, const NumberRange& range,
                         const std::string& description)
{
  using Type = typename Held<Number>::Type;
  const std::string kind = (std::is_integral_v<Type> ? "whole number in " : "number in ") + textOf(range);
  addWord(name, textOf(range), withDefault(description, value), [name, kind, range, &value](const std::string& word) {
    Type number = 0;
    // A negative number would be read as a large one when the type has no sign.
    const bool has_wrong_sign = !std::is_signed_v<Type> && word.find('-') != std::string::npos;
    if (has_wrong_sign || !boost::conversion::try_lexical_convert(word, number) ||
        !(static_cast<double>(number) >= range.low && static_cast<double>(number) <= range.high))
    {
      throw CommandLineError("--" + name + ": '" + word + "' is no " + kind);
    }
    value = number;
  });
}

template void CommandLine::number(const std::string&, double&, const NumberRange&, const std::string&);
template void CommandLine::number(const std::string&, int&, const NumberRange&, const std::string&);
template void CommandLine::number(const std::string&, std::uint64_t&, const NumberRange&, const std::string&);
template void CommandLine::number(const std::string&, std::optional<double>&, const NumberRange&, const std::string&);
template void CommandLine::number(const std::string&, std::optional<int>&, const NumberRange&, const std::string&);
template void CommandLine::number(const std::string&, std::optional<std::uint64_t>&, const NumberRange&,
                                  const std::string&);

void CommandLine::flag(const std::string& name, bool& value, const std::string& description)
{
  options_.add_options()(name.c_str(), po::bool_switch(&value), description.c_str());
}

void CommandLine::text(const std::string& name, std::string& value, const std::string& description)
{
  addWord(name, "TEXT", description, [&value](const std::string& word) { value = word; });
}

void CommandLine::choice(const std::string& name, std::string& value, const std::vector<std::string>& words,
                         const std::string& description)
{
  std::string list;
  for (const std::string& word : words)
  {
    list += (list.empty() ? "" : "|") + word;
  }
  addWord(name, list, withDefault(description, value), [name, words, list, &value](const std::string& word) {
    if (std::find(words.begin(), words.end(), word) == words.end())
    {
      throw CommandLineError("--" + name + ": '" + word + "' is not one of " + list);
    }
    value = word;
  });
}

void CommandLine::list(const std::string& name, std::vector<std::string>& values, const std::string& description,
                       char separator)
{
  const auto take = [separator, &values](const std::vector<std::string>& words) {
    for (const std::string& word : words)
    {
      std::istringstream parts(word);
      for (std::string part; std::getline(parts, part, separator);)
      {
        values.push_back(part);
      }
    }
  };
  options_.add_options()(name.c_str(),
                         po::value<std::vector<std::string>>()->value_name("TEXT")->composing()->notifier(take),
                         description.c_str());
}

std::optional<std::vector<std::string>> CommandLine::parse(int argc, const char* const* argv)
{
  po::options_description all;
  all.add(options_).add_options()(WORDS, po::value<std::vector<std::string>>());
  po::positional_options_description nameless;
  nameless.add(WORDS, -1);
  // Without short options a word after an option may begin with '-', as negative numbers do.
  namespace style = po::command_line_style;
  constexpr int LONG_OPTIONS = style::allow_long | style::long_allow_adjacent | style::long_allow_next;
  std::vector<std::string> words;
  try
  {
    po::store(po::command_line_parser(argc, argv).options(all).positional(nameless).style(LONG_OPTIONS).run(), given_);
    if (given_.count(WORDS) > 0)
    {
      words = given_[WORDS].as<std::vector<std::string>>();
    }
    if (has("help") || std::find(words.begin(), words.end(), "-h") != words.end())
    {
      std::cout << introduction_ << "\n\n" << options_ << '\n' << ending_ << '\n';
      return std::nullopt;
    }
    po::notify(given_);
  }
  catch (const po::error& error)
  {
    throw CommandLineError(std::string(error.what()) + "; see --help");
  }
  for (const std::string& word : words)
  {
    if (word.size() > 1 && word.front() == '-')
    {
      throw CommandLineError("there is no option '" + word + "'; see --help");
    }
  }
  return words;
}

}  // namespace view_servo
