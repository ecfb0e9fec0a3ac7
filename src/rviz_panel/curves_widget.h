// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "rviz_panel/robot_snapshot.h"

#include <QtWidgets/QWidget>

#include <deque>

namespace view_servo
{
/** Draws the errors of the last minute as curves, each scaled by its own largest value, which stands in brackets. */
class CurvesWidget : public QWidget
{
public:
  explicit CurvesWidget(QWidget* parent = nullptr);

  void setErrors(const std::deque<ErrorSample>& errors);

protected:
  void paintEvent(QPaintEvent* event) override;

private:
  std::deque<ErrorSample> errors_;
};

}  // namespace view_servo
