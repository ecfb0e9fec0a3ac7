// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "rviz_panel/robot_link.h"
#include "rviz_panel/robot_snapshot.h"

#include <QtWidgets/QWidget>

#include <memory>
#include <string>

class QCheckBox;
class QComboBox;
class QLabel;
class QLineEdit;
class QListWidget;
class QPushButton;
class QTimer;

namespace view_servo
{
class CurvesWidget;
class PictureWidget;

/** What the panel shows, without rviz. ros::init() comes first. */
class ViewsWidget : public QWidget
{
  Q_OBJECT

public:
  explicit ViewsWidget(QWidget* parent = nullptr);
  ~ViewsWidget() override;

  /** Turns to a robot. Goals that were sent go on. */
  void setNames(const RobotNames& names);
  const RobotNames& names() const
  {
    return names_;
  }
  void setOverlayShown(bool shown);
  bool isOverlayShown() const;

  /** Connects with the robot; before, nothing is known of it. */
  void start();

Q_SIGNALS:
  /** The user has changed the names, or whether the overlay is shown. */
  void settingsChanged();

private:
  void buildPictures(QWidget* place);
  void buildControls(QWidget* place);
  void refresh();
  void showPictures(const RobotSnapshot& robot);
  void showLight(const RobotSnapshot& robot);
  void showViews(const RobotSnapshot& robot);
  void showTopics(const RobotSnapshot& robot);
  void showRegion();
  void takeNames();
  void store();
  /** Deletes the selected view, if the button has just been pressed for the same one. */
  void deleteView();
  /** Lets the button tell whether the next press deletes. @param view empty: it does not. */
  void arm(const std::string& view);
  std::string selectedView() const;

  RobotNames names_;
  std::unique_ptr<RobotLink> link_;
  cv::Mat camera_picture_;
  unsigned shown_views_ = 0;
  unsigned shown_words_ = 0;
  unsigned shown_picture_ = 0;
  bool shows_overlay_ = false;
  bool shows_fault_ = false;  // in place of the views
  bool has_region_ = false;
  std::string armed_;  // the view that the next press of Delete deletes; empty: it asks

  PictureWidget* picture_ = nullptr;
  QLabel* region_ = nullptr;
  CurvesWidget* curves_ = nullptr;
  QPushButton* stop_ = nullptr;
  QLabel* lamp_ = nullptr;
  QLabel* state_ = nullptr;
  QLabel* dry_run_ = nullptr;
  QListWidget* views_ = nullptr;
  QPushButton* enable_ = nullptr;
  QPushButton* go_ = nullptr;
  QPushButton* reload_ = nullptr;
  QPushButton* delete_ = nullptr;
  QTimer* disarm_ = nullptr;
  QLineEdit* name_ = nullptr;
  QCheckBox* replace_ = nullptr;
  QCheckBox* learn_ = nullptr;
  QPushButton* store_ = nullptr;
  QLabel* words_ = nullptr;
  QLineEdit* robot_ = nullptr;
  QComboBox* camera_ = nullptr;
  QComboBox* overlay_ = nullptr;
  QCheckBox* show_overlay_ = nullptr;
};

}  // namespace view_servo
