// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "rviz_panel/views_panel.h"

#include "rviz_panel/views_widget.h"

#include <QtWidgets/QVBoxLayout>
#include <pluginlib/class_list_macros.hpp>

namespace view_servo
{
namespace
{
const char* const ROBOT_KEY = "Robot Namespace";
const char* const CAMERA_KEY = "Camera Topic";
const char* const OVERLAY_KEY = "Overlay Topic";
const char* const SHOWN_KEY = "Show Overlay";
}  // namespace

ViewsPanel::ViewsPanel(QWidget* parent) : rviz::Panel(parent), widget_(new ViewsWidget(this))
{
  auto* layout = new QVBoxLayout(this);
  layout->setContentsMargins(0, 0, 0, 0);
  layout->addWidget(widget_);
  connect(widget_, &ViewsWidget::settingsChanged, this, &rviz::Panel::configChanged);
}

void ViewsPanel::onInitialize()
{
  widget_->start();
}

void ViewsPanel::load(const rviz::Config& config)
{
  rviz::Panel::load(config);
  RobotNames names = widget_->names();
  const auto read = [&](const char* key, std::string& place) {
    QString text;
    if (config.mapGetString(key, &text))
    {
      place = text.toStdString();
    }
  };
  read(ROBOT_KEY, names.robot_namespace);
  read(CAMERA_KEY, names.camera_topic);
  read(OVERLAY_KEY, names.overlay_topic);
  widget_->setNames(names);
  bool shown = false;
  if (config.mapGetBool(SHOWN_KEY, &shown))
  {
    widget_->setOverlayShown(shown);
  }
}

void ViewsPanel::save(rviz::Config config) const
{
  rviz::Panel::save(config);
  const RobotNames& names = widget_->names();
  config.mapSetValue(ROBOT_KEY, QString::fromStdString(names.robot_namespace));
  config.mapSetValue(CAMERA_KEY, QString::fromStdString(names.camera_topic));
  config.mapSetValue(OVERLAY_KEY, QString::fromStdString(names.overlay_topic));
  config.mapSetValue(SHOWN_KEY, widget_->isOverlayShown());
}

}  // namespace view_servo

PLUGINLIB_EXPORT_CLASS(view_servo::ViewsPanel, rviz::Panel)
