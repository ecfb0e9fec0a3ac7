// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "rviz_panel/views_widget.h"

#include "rviz_panel/curves_widget.h"
#include "rviz_panel/picture_widget.h"
#include "rviz_panel/robot_light.h"
#include "tools/region_judgement.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/seconds_since.h"

#include <ros/time.h>
#include <QtCore/QSignalBlocker>
#include <QtCore/QTimer>
#include <QtGui/QIcon>
#include <QtGui/QImage>
#include <QtGui/QPixmap>
#include <QtWidgets/QAbstractItemView>
#include <QtWidgets/QCheckBox>
#include <QtWidgets/QComboBox>
#include <QtWidgets/QFormLayout>
#include <QtWidgets/QHBoxLayout>
#include <QtWidgets/QLabel>
#include <QtWidgets/QLineEdit>
#include <QtWidgets/QListWidget>
#include <QtWidgets/QPushButton>
#include <QtWidgets/QVBoxLayout>

#include <chrono>
#include <exception>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
constexpr int PERIOD = 100;          // of looking at what has come [ms]
constexpr int ASKED = 3000;          // so long Delete waits to be pressed again [ms]
constexpr double OLD_PICTURE = 2.0;  // what is shown is called old from this age on [s]
constexpr int NAME_ROLE = Qt::UserRole;
constexpr int STAMP_ROLE = Qt::UserRole + 1;
constexpr int FAULT_ROLE = Qt::UserRole + 2;

QString toQt(const std::string& text)
{
  return QString::fromStdString(text);
}

QString age(double stamp)
{
  if (stamp <= 0.0)
  {
    return "";
  }
  const double seconds = ros::Time::now().toSec() - stamp;
  if (seconds < 0.0)
  {
    return "stamped in the future";
  }
  constexpr double MINUTE = 60.0;
  constexpr double HOUR = 60.0 * MINUTE;
  constexpr double DAY = 24.0 * HOUR;
  const std::vector<std::pair<double, const char*>> units = { { DAY, "days" }, { HOUR, "h" }, { MINUTE, "min" } };
  for (const auto& [length, unit] : units)
  {
    if (seconds >= 2.0 * length)
    {
      return QString("%1 %2 ago").arg(static_cast<int>(seconds / length)).arg(unit);
    }
  }
  return QString("%1 s ago").arg(static_cast<int>(seconds));
}

QLabel* wrappedLabel(const QString& name, int lines)
{
  auto* label = new QLabel;
  label->setObjectName(name);
  label->setWordWrap(true);
  label->setTextFormat(Qt::PlainText);
  label->setAlignment(Qt::AlignLeft | Qt::AlignTop);
  label->setMinimumHeight(lines * label->fontMetrics().lineSpacing());
  return label;
}

QPushButton* button(const QString& text, const QString& name)
{
  auto* made = new QPushButton(text);
  made->setObjectName(name);
  made->setMinimumWidth(40);
  return made;
}

QComboBox* topicBox(const QString& name)
{
  auto* box = new QComboBox;
  box->setObjectName(name);
  box->setEditable(true);
  box->setInsertPolicy(QComboBox::NoInsert);
  box->setMinimumWidth(60);
  box->setSizeAdjustPolicy(QComboBox::AdjustToMinimumContentsLengthWithIcon);
  return box;
}

}  // namespace

ViewsWidget::ViewsWidget(QWidget* parent) : QWidget(parent)
{
  auto* pictures = new QWidget;
  auto* controls = new QWidget;
  buildPictures(pictures);
  buildControls(controls);
  controls->setFixedWidth(246);
  auto* layout = new QHBoxLayout(this);
  layout->setContentsMargins(4, 4, 4, 4);
  layout->setSpacing(8);
  layout->addWidget(pictures, 1);
  layout->addWidget(controls);

  picture_->on_region = [this] {
    showRegion();
  };
  // When the button goes down, not up: somebody is in a hurry.
  connect(stop_, &QPushButton::pressed, this, [this] {
    if (link_)
    {
      link_->stop();
    }
  });
  connect(enable_, &QPushButton::clicked, this, [this] {
    if (link_)
    {
      link_->enable();
    }
  });
  connect(go_, &QPushButton::clicked, this, [this] {
    if (link_ && !selectedView().empty())
    {
      link_->go(selectedView());
    }
  });
  connect(reload_, &QPushButton::clicked, this, [this] {
    if (link_)
    {
      link_->reloadViews();
    }
  });
  connect(delete_, &QPushButton::clicked, this, &ViewsWidget::deleteView);
  disarm_ = new QTimer(this);
  disarm_->setSingleShot(true);
  connect(disarm_, &QTimer::timeout, this, [this] { arm(""); });
  connect(views_, &QListWidget::currentItemChanged, this, [this] {
    if (selectedView() != armed_)
    {
      arm("");
    }
  });
  connect(store_, &QPushButton::clicked, this, &ViewsWidget::store);
  connect(name_, &QLineEdit::returnPressed, this, &ViewsWidget::store);
  connect(robot_, &QLineEdit::editingFinished, this, &ViewsWidget::takeNames);
  for (QComboBox* box : { camera_, overlay_ })
  {
    connect(box->lineEdit(), &QLineEdit::editingFinished, this, &ViewsWidget::takeNames);
    connect(box, static_cast<void (QComboBox::*)(int)>(&QComboBox::activated), this, &ViewsWidget::takeNames);
  }
  connect(show_overlay_, &QCheckBox::toggled, this, [this](bool shown) {
    if (link_)
    {
      link_->showOverlay(shown);
    }
    Q_EMIT settingsChanged();
  });
  auto* timer = new QTimer(this);
  connect(timer, &QTimer::timeout, this, &ViewsWidget::refresh);
  timer->start(PERIOD);
  setNames(names_);
  showRegion();
}

ViewsWidget::~ViewsWidget() = default;

void ViewsWidget::buildPictures(QWidget* place)
{
  picture_ = new PictureWidget;
  picture_->setObjectName("picture");
  region_ = wrappedLabel("region", 2);
  curves_ = new CurvesWidget;
  auto* layout = new QVBoxLayout(place);
  layout->setContentsMargins(0, 0, 0, 0);
  layout->addWidget(picture_, 1);
  layout->addWidget(region_);
  layout->addWidget(curves_);
}

void ViewsWidget::buildControls(QWidget* place)
{
  stop_ = button("STOP", "stop");
  stop_->setFixedHeight(60);
  stop_->setStyleSheet(
      "QPushButton { background: #c8281e; color: white; font-size: 22px; font-weight: bold; "
      "border: none; border-radius: 5px; } QPushButton:pressed { background: #8c1410; }");
  lamp_ = new QLabel;
  lamp_->setObjectName("lamp");
  lamp_->setFixedSize(30, 30);
  state_ = wrappedLabel("state", 3);
  dry_run_ = new QLabel("DRY RUN: nothing moves");
  dry_run_->setObjectName("dry_run");
  dry_run_->setStyleSheet("background: #f0c040; color: black; font-weight: bold; padding: 2px;");
  dry_run_->hide();
  auto* light = new QHBoxLayout;
  light->addWidget(lamp_, 0, Qt::AlignTop);
  light->addWidget(state_, 1);

  views_ = new QListWidget;
  views_->setObjectName("views");
  views_->setIconSize(QSize(96, 72));
  views_->setMinimumHeight(80);
  views_->setHorizontalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
  views_->setWordWrap(true);
  enable_ = button("Enable", "enable");
  go_ = button("Go", "go");
  reload_ = button("Reload", "reload");
  delete_ = button("Delete", "delete");
  auto* drive = new QHBoxLayout;
  drive->addWidget(enable_);
  drive->addWidget(go_);
  auto* list = new QHBoxLayout;
  list->addWidget(reload_);
  list->addWidget(delete_);

  name_ = new QLineEdit;
  name_->setObjectName("name");
  name_->setPlaceholderText("name of a new view");
  replace_ = new QCheckBox("Replace");
  replace_->setObjectName("replace");
  learn_ = new QCheckBox("Learn");
  learn_->setObjectName("learn");
  learn_->setToolTip("homing learns where things are while somebody drives the base 0.3 m away");
  store_ = button("Store", "store");
  auto* keep = new QHBoxLayout;
  keep->addWidget(replace_);
  keep->addWidget(learn_);
  keep->addWidget(store_, 1);
  words_ = wrappedLabel("words", 4);

  robot_ = new QLineEdit;
  robot_->setObjectName("robot");
  robot_->setPlaceholderText("none");
  camera_ = topicBox("camera");
  overlay_ = topicBox("overlay");
  show_overlay_ = new QCheckBox("Show matches");
  show_overlay_->setObjectName("show_overlay");
  auto* settings = new QFormLayout;
  settings->setFieldGrowthPolicy(QFormLayout::AllNonFixedFieldsGrow);
  settings->addRow("Robot", robot_);
  settings->addRow("Camera", camera_);
  settings->addRow("Matches", overlay_);
  settings->addRow("", show_overlay_);

  auto* layout = new QVBoxLayout(place);
  layout->setContentsMargins(0, 0, 0, 0);
  layout->addWidget(stop_);
  layout->addLayout(light);
  layout->addWidget(dry_run_);
  layout->addWidget(views_, 1);
  layout->addLayout(list);
  layout->addLayout(drive);
  layout->addWidget(name_);
  layout->addLayout(keep);
  layout->addWidget(words_);
  layout->addLayout(settings);
}

void ViewsWidget::setNames(const RobotNames& names)
{
  const bool changed = !(names == names_);
  names_ = names;
  const QSignalBlocker robot(robot_);
  const QSignalBlocker camera(camera_);
  const QSignalBlocker overlay(overlay_);
  robot_->setText(toQt(names.robot_namespace));
  camera_->setEditText(toQt(names.camera_topic));
  overlay_->setEditText(toQt(names.overlay_topic));
  if (changed && link_)
  {
    start();
  }
}

void ViewsWidget::setOverlayShown(bool shown)
{
  show_overlay_->setChecked(shown);
}

bool ViewsWidget::isOverlayShown() const
{
  return show_overlay_->isChecked();
}

void ViewsWidget::start()
{
  link_.reset();
  link_ = std::make_unique<RobotLink>(names_);
  link_->showOverlay(isOverlayShown());
  shown_views_ = shown_words_ = shown_picture_ = 0;
  shows_fault_ = false;
  camera_picture_.release();
  views_->clear();
  words_->clear();
  arm("");
  refresh();
}

void ViewsWidget::refresh()
{
  if (!link_)
  {
    return;
  }
  const RobotSnapshot robot = link_->snapshot();
  showPictures(robot);
  showLight(robot);
  showViews(robot);
  showTopics(robot);
  curves_->setErrors(robot.errors);
  if (robot.words.count != shown_words_)
  {
    shown_words_ = robot.words.count;
    words_->setText(toQt(robot.words.text));
    words_->setStyleSheet(robot.words.is_good ? "" : "color: #b01010;");
  }
  store_->setEnabled(!name_->text().isEmpty());
  go_->setEnabled(!selectedView().empty());
  delete_->setEnabled(!selectedView().empty());
}

void ViewsWidget::showPictures(const RobotSnapshot& robot)
{
  camera_picture_ = robot.camera.picture;
  const bool has_overlay =
      isOverlayShown() && !robot.overlay.picture.empty() && secondsSince(robot.overlay.since) < OLD_PICTURE;
  const TopicPicture& shown = has_overlay ? robot.overlay : robot.camera;
  const double silence = secondsSince(shown.since);
  const bool is_old = silence > OLD_PICTURE;
  if (shown.topic.empty())
  {
    picture_->setText("No topic of pictures is named: see Camera");
  }
  else if (!shown.fault.empty())
  {
    picture_->setText(toQt(shown.topic + ": " + shown.fault));
  }
  else if (is_old)
  {
    picture_->setText(
        toQt("No image has come for " + std::to_string(static_cast<int>(silence)) + " s on " + shown.topic));
  }
  // A picture that is old, or is followed by one that cannot be shown, is not taken for what the camera sees.
  if (is_old || shown.picture.empty() || !shown.fault.empty())
  {
    picture_->setPicture(cv::Mat(), false);
    shown_picture_ = 0;
  }
  else if (shown.count != shown_picture_ || has_overlay != shows_overlay_)
  {
    picture_->setPicture(shown.picture, !has_overlay);
    shown_picture_ = shown.count;
  }
  if (has_overlay != shows_overlay_ || (has_region_ && picture_->region().empty()))
  {
    shows_overlay_ = has_overlay;
    showRegion();
  }
}

void ViewsWidget::showLight(const RobotSnapshot& robot)
{
  const RobotLight light = judgeRobot(robot);
  const char* colour = light.colour == RobotLight::GREEN   ? "#3cc850"
                       : light.colour == RobotLight::AMBER ? "#f0a820"
                       : light.colour == RobotLight::RED   ? "#d82818"
                                                           : "#909090";
  const QString style = QString("background: %1; border: 2px solid #303030; border-radius: 15px;").arg(colour);
  if (lamp_->styleSheet() != style)
  {
    lamp_->setStyleSheet(style);
  }
  state_->setText(toQt(light.text));
  dry_run_->setVisible(light.dry_run);
}

void ViewsWidget::showViews(const RobotSnapshot& robot)
{
  // What was listed may have changed meanwhile, so it is not shown until the store is there again.
  if (!robot.views_fault.empty())
  {
    const QString text = toQt("No views: " + robot.views_fault);
    if (!shows_fault_ || views_->item(0)->text() != text)
    {
      views_->clear();
      auto* item = new QListWidgetItem(text);
      item->setFlags(Qt::ItemIsEnabled);
      views_->addItem(item);
      shows_fault_ = true;
    }
    return;
  }
  if (robot.views_count != shown_views_ || shows_fault_)
  {
    shows_fault_ = false;
    shown_views_ = robot.views_count;
    const std::string selected = selectedView();
    views_->clear();
    for (const ListedView& view : robot.views)
    {
      auto* item = new QListWidgetItem;
      item->setData(NAME_ROLE, toQt(view.name));
      item->setData(STAMP_ROLE, view.stamp);
      item->setData(FAULT_ROLE, toQt(view.fault));
      if (!view.thumbnail.empty())
      {
        const cv::Mat& grey = view.thumbnail;
        const QImage image(grey.data, grey.cols, grey.rows, static_cast<int>(grey.step), QImage::Format_Grayscale8);
        QIcon icon(QPixmap::fromImage(image));
        icon.addPixmap(QPixmap::fromImage(image), QIcon::Selected);  // not tinted
        item->setIcon(icon);
      }
      views_->addItem(item);
      if (view.name == selected)
      {
        views_->setCurrentItem(item);
      }
    }
  }
  for (int k = 0; k < views_->count(); ++k)
  {
    QListWidgetItem& item = *views_->item(k);
    const QString fault = item.data(FAULT_ROLE).toString();
    const QString text =
        item.data(NAME_ROLE).toString() + "\n" + (fault.isEmpty() ? age(item.data(STAMP_ROLE).toDouble()) : fault);
    if (item.text() != text)
    {
      item.setText(text);
      item.setToolTip(fault);
    }
  }
}

void ViewsWidget::showTopics(const RobotSnapshot& robot)
{
  for (QComboBox* box : { camera_, overlay_ })
  {
    bool is_same = static_cast<std::size_t>(box->count()) == robot.image_topics.size();
    for (std::size_t k = 0; is_same && k < robot.image_topics.size(); ++k)
    {
      is_same = box->itemText(static_cast<int>(k)) == toQt(robot.image_topics[k]);
    }
    if (!is_same && !box->view()->isVisible() && !box->lineEdit()->hasFocus())
    {
      const QSignalBlocker blocker(box);
      const QString text = box->currentText();
      box->clear();
      for (const std::string& topic : robot.image_topics)
      {
        box->addItem(toQt(topic));
      }
      box->setEditText(text);
    }
  }
}

void ViewsWidget::showRegion()
{
  const cv::Rect region = picture_->region();
  has_region_ = !region.empty();
  if (!has_region_ || camera_picture_.empty())
  {
    region_->setText(shows_overlay_ ? "Untick 'Show matches' to drag a region for Store"
                                    : "Drag a region on the picture for Store; a click: everywhere");
    region_->setStyleSheet("");
    return;
  }
  const RegionJudgement judgement = judgeRegion(camera_picture_, region);
  region_->setText(toQt(judgement.text));
  region_->setStyleSheet(judgement.is_good ? "" : "color: #b06000;");
}

void ViewsWidget::takeNames()
{
  RobotNames names;
  names.robot_namespace = robot_->text().trimmed().toStdString();
  names.camera_topic = camera_->currentText().trimmed().toStdString();
  names.overlay_topic = overlay_->currentText().trimmed().toStdString();
  if (!(names == names_))
  {
    setNames(names);
    Q_EMIT settingsChanged();
  }
}

void ViewsWidget::store()
{
  if (link_ && !name_->text().isEmpty())
  {
    link_->store(name_->text().toStdString(), picture_->region(), replace_->isChecked(), learn_->isChecked());
  }
}

// It is asked by the button itself: a dialog would be in the way of Stop.
void ViewsWidget::deleteView()
{
  const std::string view = selectedView();
  if (!link_ || view.empty())
  {
    return;
  }
  if (armed_ != view)
  {
    arm(view);
    return;
  }
  arm("");
  link_->deleteView(view);
}

void ViewsWidget::arm(const std::string& view)
{
  armed_ = view;
  delete_->setText(view.empty() ? "Delete" : "Really delete?");
  delete_->setStyleSheet(view.empty() ? "" : "color: #b01010;");
  view.empty() ? disarm_->stop() : disarm_->start(ASKED);
}

std::string ViewsWidget::selectedView() const
{
  const QListWidgetItem* item = views_->currentItem();
  return item == nullptr ? "" : item->data(NAME_ROLE).toString().toStdString();
}

}  // namespace view_servo
