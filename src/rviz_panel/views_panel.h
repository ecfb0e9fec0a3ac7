// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <rviz/panel.h>

namespace view_servo
{
class ViewsWidget;

/** The panel view_servo/Views of rviz, which keeps the widget's settings in rviz's configuration. */
class ViewsPanel : public rviz::Panel
{
  Q_OBJECT

public:
  explicit ViewsPanel(QWidget* parent = nullptr);

  void onInitialize() override;
  void load(const rviz::Config& config) override;
  void save(rviz::Config config) const override;

private:
  ViewsWidget* widget_;
};

}  // namespace view_servo
