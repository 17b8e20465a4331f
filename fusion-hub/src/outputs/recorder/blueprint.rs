//! A layout as a tree of containers and views, and its form in a blueprint.
//!
//! Rerun's own builder cannot set the range of a time axis, the place of a legend or the eye of a 3D view; the
//! entities below are those that it would write, with these beside them.

use rerun::blueprint::components::{
    ActiveTab, AutoLayout, AutoViews, ColumnShare, ContainerKind, IncludedContent, QueryExpression,
    RootContainer, RowShare, ViewClass,
};
use rerun::external::re_sdk_types::blueprint::archetypes::{
    ContainerBlueprint, ViewBlueprint, ViewContents, ViewportBlueprint,
};
use rerun::external::uuid::Uuid;
use rerun::{AsComponents, EntityPath};

/// Entities of a blueprint.
pub(super) type Entities = Vec<(EntityPath, Box<dyn AsComponents>)>;

/// A node of the layout.
pub(super) enum Node {
    /// Children side by side, one below the other, or as tabs.
    Container(Container),
    /// A view.
    View(View),
}

/// Several nodes.
pub(super) struct Container {
    kind: ContainerKind,
    name: String,
    /// Children with their share of the container's width or height.
    children: Vec<(f32, Node)>,
}

/// One view.
pub(super) struct View {
    class: &'static str,
    name: String,
    contents: Vec<String>,
    properties: Vec<(&'static str, Box<dyn AsComponents>)>,
}

impl View {
    /// A view of Rerun's class with its contents as query expressions.
    pub fn new(class: &'static str, name: impl Into<String>, contents: Vec<String>) -> Self {
        Self { class, name: name.into(), contents, properties: Vec::new() }
    }

    /// Adds a property; `name` is that of its archetype.
    pub fn with(mut self, name: &'static str, property: impl AsComponents + 'static) -> Self {
        self.properties.push((name, Box::new(property)));
        self
    }
}

impl From<View> for Node {
    fn from(view: View) -> Self {
        Self::View(view)
    }
}

/// Children side by side. The name is shown where the container is a tab.
pub(super) fn horizontal(name: &str, children: Vec<(f32, Node)>) -> Node {
    container(ContainerKind::Horizontal, name, children)
}

/// Children one below the other. The name is shown where the container is a tab.
pub(super) fn vertical(name: &str, children: Vec<(f32, Node)>) -> Node {
    container(ContainerKind::Vertical, name, children)
}

/// Children as tabs, the first one open.
pub(super) fn tabs(name: &str, children: Vec<Node>) -> Node {
    container(ContainerKind::Tabs, name, children.into_iter().map(|child| (1.0, child)).collect())
}

fn container(kind: ContainerKind, name: &str, children: Vec<(f32, Node)>) -> Node {
    Node::Container(Container { kind, name: name.to_owned(), children })
}

/// The entities of a layout.
pub(super) fn entities(root: Container) -> Entities {
    let mut entities = Entities::new();
    let id = Uuid::new_v4();
    write_container(root, id, &mut entities);
    let viewport = ViewportBlueprint::new()
        .with_root_container(RootContainer(id.into()))
        .with_auto_layout(AutoLayout::from(false))
        .with_auto_views(AutoViews::from(false));
    entities.push(("viewport".into(), Box::new(viewport)));
    entities
}

fn write(node: Node, entities: &mut Entities) -> String {
    let id = Uuid::new_v4();
    match node {
        Node::Container(container) => write_container(container, id, entities),
        Node::View(view) => write_view(view, id, entities),
    }
}

fn write_container(container: Container, id: Uuid, entities: &mut Entities) -> String {
    let path = format!("container/{id}");
    let Container { kind, name, children } = container;
    let (shares, children): (Vec<f32>, Vec<Node>) = children.into_iter().unzip();
    let contents: Vec<String> = children.into_iter().map(|child| write(child, entities)).collect();
    let mut blueprint = ContainerBlueprint::new(kind);
    if !name.is_empty() {
        blueprint = blueprint.with_display_name(name);
    }
    blueprint = match kind {
        ContainerKind::Horizontal => blueprint.with_col_shares(shares.into_iter().map(ColumnShare::from)),
        ContainerKind::Vertical => blueprint.with_row_shares(shares.into_iter().map(RowShare::from)),
        ContainerKind::Tabs | ContainerKind::Grid => match contents.first() {
            Some(first) => blueprint.with_active_tab(ActiveTab(first.as_str().into())),
            None => blueprint,
        },
    };
    blueprint = blueprint.with_contents(contents.iter().map(|c| IncludedContent(c.as_str().into())));
    entities.push((path.as_str().into(), Box::new(blueprint)));
    path
}

fn write_view(view: View, id: Uuid, entities: &mut Entities) -> String {
    let path = format!("view/{id}");
    let View { class, name, contents, properties } = view;
    let contents = ViewContents::new(contents.iter().map(|c| QueryExpression(c.as_str().into())));
    entities.push((format!("{path}/ViewContents").into(), Box::new(contents)));
    let blueprint =
        ViewBlueprint::new(ViewClass(class.into())).with_display_name(name).with_space_origin("/");
    entities.push((path.as_str().into(), Box::new(blueprint)));
    for (property, components) in properties {
        entities.push((format!("{path}/{property}").into(), components));
    }
    path
}
